/* The bare chain of quaternion products, and calls of the generated loop, each timed by the caller. */
#include <stddef.h>

#include "euler_rk4_2.c"
#include "euler_rk4_2_runs.c"

/* Products with `steps` quaternions, the state in registers. */
void chain(size_t steps, const double *transitions, double *state)
{
    double x = state[0], y = state[1], z = state[2], s = state[3];
    for (size_t k = 0; k < steps; ++k) {
        const double *p = transitions + 4 * k;
        const double next_s = s * p[3] - x * p[0] - y * p[1] - z * p[2];
        const double next_x = s * p[0] + x * p[3] + y * p[2] - z * p[1];
        const double next_y = s * p[1] - x * p[2] + y * p[3] + z * p[0];
        const double next_z = s * p[2] + x * p[1] - y * p[0] + z * p[3];
        x = next_x;
        y = next_y;
        z = next_z;
        s = next_s;
    }
    state[0] = x;
    state[1] = y;
    state[2] = z;
    state[3] = s;
}
