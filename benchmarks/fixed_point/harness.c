/* Steps one after the other, each on the result of the one before; compiled together with the step, so that it may be
 * inlined.
 */
#include <stddef.h>

#include STEP

int chained(size_t times, size_t steps, const word *samples, const word *initial, void *kept, word *state)
{
    int refused = 0;
    for (size_t time = 0; time < times; ++time) {
        for (size_t k = 0; k < 4; ++k)
            state[k] = initial[k];
        for (size_t k = 0; k < steps; ++k)
            refused |= step(state, samples + 6 * k, kept, state);
    }
    return refused;
}
