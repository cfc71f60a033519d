/* Counts the operations of one step by running its source on numbers that count. What is done with constants alone is
 * done by the compiler and does not count. */
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <math.h>

struct Counted {
    double value;
    bool constant;
    static long add, multiply, divide, negate;
    Counted(double v = 0.0) : value(v), constant(true) {}
    Counted(double v, bool c) : value(v), constant(c) {}
};
long Counted::add, Counted::multiply, Counted::divide, Counted::negate;

#define OPERATION(SIGN, COUNTER)                                                            \
    inline Counted operator SIGN(Counted a, Counted b)                                      \
    {                                                                                       \
        const bool constant = a.constant && b.constant;                                     \
        Counted::COUNTER += !constant;                                                      \
        return Counted(a.value SIGN b.value, constant);                                     \
    }                                                                                       \
    inline Counted &operator SIGN##=(Counted &a, Counted b) { return a = a SIGN b; }
OPERATION(+, add)
OPERATION(-, add)
OPERATION(*, multiply)
OPERATION(/, divide)

inline Counted operator-(Counted a)
{
    Counted::negate += !a.constant;
    return Counted(-a.value, a.constant);
}
inline Counted pow(Counted a, int n)
{
    return n < 0 ? Counted(1.0) / pow(a, -n) : n == 1 ? a : n == 2 ? a * a : n == 3 ? a * a * a : n == 4 ? a * a * (a * a) : a * pow(a, n - 1);
}
inline Counted sqrt(Counted a) { return Counted(std::sqrt(a.value), a.constant); }
inline Counted sin(Counted a) { return Counted(std::sin(a.value), a.constant); }
inline Counted cos(Counted a) { return Counted(std::cos(a.value), a.constant); }
namespace std {
inline Counted sqrt(Counted a) { return ::sqrt(a); }
inline Counted sin(Counted a) { return ::sin(a); }
inline Counted cos(Counted a) { return ::cos(a); }
inline Counted pow(Counted a, Counted n) { return ::pow(a, int(n.value)); }
}

/* Runs work in vectors, which only numbers of the processor have. */
#define COUNTED
#define double Counted
#include "step.inc"
#undef double

#ifndef OUTPUTS
#define OUTPUTS STATE
#endif

int main()
{
    Counted state[STATE], samples[SAMPLES], next[OUTPUTS];
    for (int k = 0; k < STATE; ++k)
        state[k] = Counted(1.0 / (k + 2), false);
    for (int k = 0; k < SAMPLES; ++k)
        samples[k] = Counted(1.0 / (k + 9), false);
    step(state, samples, next);
    std::printf("%ld %ld %ld %ld\n", Counted::multiply, Counted::add, Counted::divide, Counted::negate);
}
