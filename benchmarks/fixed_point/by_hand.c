/* The stages of the method as the textbook has them, on words of 32 bits.
 *
 * Half the rate times the step, h, has 34 bits of fraction; a slope k, the product of state and h, has 32, so that it is
 * the high word of its sum of products. Largest values, for states of up to 1.0625 and increments of up to 0.0349:
 * h 0.0699 at the ends and 0.035 in the middle; slopes 0.223, 0.124, 0.118, 0.248; so nothing overflows.
 */
#include "by_hand.h"

#define STATE_LIMIT 1140850688 /* 1.0625 */
#define INCREMENT_LIMIT 599690565 /* 400 deg/s for 5 ms */
#define SIXTH 715827883 /* 1/6, times 2^32 */

/* x / 2^32, to the nearest. */
static inline int32_t high_word(int64_t x)
{
    return (int32_t)((x + ((int64_t)1 << 31)) >> 32);
}

static inline int64_t product(int32_t a, int32_t b)
{
    return (int64_t)a * b;
}

static inline void slope_of(const int32_t e[4], const int32_t h[3], int32_t k[4])
{
    k[0] = high_word(product(e[3], h[0]) + product(e[1], h[2]) - product(e[2], h[1]));
    k[1] = high_word(product(e[3], h[1]) + product(e[2], h[0]) - product(e[0], h[2]));
    k[2] = high_word(product(e[3], h[2]) + product(e[0], h[1]) - product(e[1], h[0]));
    k[3] = high_word(-product(e[0], h[0]) - product(e[1], h[1]) - product(e[2], h[2]));
}

/* e + k / 2^shift in the units of k's 32 bits of fraction, to the nearest; e has 30. */
static inline void moved(const int32_t e[4], const int32_t k[4], int shift, int32_t result[4])
{
    for (int i = 0; i < 4; ++i)
        result[i] = e[i] + ((k[i] + (1 << (shift + 1))) >> (shift + 2));
}

static inline int beyond(int32_t x, int32_t limit)
{
    return x > limit || x < -limit;
}

int by_hand(const int32_t state[4], const int32_t increments[6], int32_t next[4])
{
    int32_t start[3], middle[3], end[3], a[4], b[4], c[4], d[4], at[4];
    for (int i = 0; i < 4; ++i)
        if (beyond(state[i], STATE_LIMIT))
            return 1;
    for (int i = 0; i < 6; ++i)
        if (beyond(increments[i], INCREMENT_LIMIT))
            return 1;
    for (int i = 0; i < 3; ++i) {
        const int32_t first = increments[i], second = increments[3 + i];
        start[i] = first + ((first - second + 1) >> 1); /* (3 first - second) / 2 */
        middle[i] = (first + second + 1) >> 1;
        end[i] = second + ((second - first + 1) >> 1);
    }
    slope_of(state, start, a);
    moved(state, a, 1, at);
    slope_of(at, middle, b);
    moved(state, b, 1, at);
    slope_of(at, middle, c);
    moved(state, c, 0, at);
    slope_of(at, end, d);
    for (int i = 0; i < 4; ++i) {
        const int64_t sum = (int64_t)a[i] + d[i] + 2 * ((int64_t)b[i] + c[i]);
        next[i] = state[i] + high_word(product((int32_t)((sum + 2) >> 2), SIXTH));
    }
    return 0;
}
