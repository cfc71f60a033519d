// A table turns by 90 deg/s for a second: what heading does the generated C++ return?
#include "euler_normalize.hpp"
#include "euler_rk4_2.hpp"

#include <cmath>
#include <cstdio>

int main()
{
    const double deg = std::acos(-1.0) / 180.0;
    const double increment = 90.0 * deg * 0.01; // rad in a sample of 0.01 s
    std::array<double, 4> state = strapgen::euler_rk4_2_identity;
    for (int step = 0; step < 50; ++step) // two increments a step, x, y, z of the first and then of the second
        state = strapgen::euler_rk4_2(state, {{0.0, 0.0, increment, 0.0, 0.0, increment}});
    state = strapgen::euler_normalize(state);
    std::printf("heading %.9f deg\n", 2.0 * std::atan2(state[2], state[3]) / deg);
    return 0;
}
