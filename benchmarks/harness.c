/* Loops around the step of one generator, compiled together with it so that the compiler may inline. C and C++. */
#include <stddef.h>

#include "step.inc"

#ifdef __cplusplus
extern "C" {
#endif

void one(const double *state, const double *samples, double *next)
{
    step(state, samples, next);
}

/* Every step waits for the one before. */
void chained(size_t times, size_t steps, const double *samples, const double *initial, double *state)
{
    for (size_t time = 0; time < times; ++time) {
        for (size_t k = 0; k < STATE; ++k)
            state[k] = initial[k];
        for (size_t k = 0; k < steps; ++k)
            step(state, samples + SAMPLES * k, state);
    }
}

/* No step waits for another. */
void independent(size_t times, size_t runs, const double *samples, const double *states, double *next)
{
    for (size_t time = 0; time < times; ++time)
        for (size_t k = 0; k < runs; ++k)
            step(states + STATE * k, samples + SAMPLES * k, next + STATE * k);
}

#ifdef HAS_LOOPS
/* The same by the loops that the generator writes itself; the batch has its arrays by element. */
void chained_loop(size_t times, size_t steps, const double *samples, const double *initial, double *state)
{
    double history[2 * STATE];
    for (size_t time = 0; time < times; ++time)
        loop(steps, samples, initial, history);
    for (size_t k = 0; k < STATE; ++k)
        state[k] = history[STATE + k];
}

void independent_loop(size_t times, size_t runs, const double *samples, const double *states, double *next)
{
    for (size_t time = 0; time < times; ++time)
        batch(runs, states, samples, next);
}
#endif

#ifdef __cplusplus
}
#endif
