/* The formulas of the generated step, tuned by hand for a processor that multiplies words to 64 bits.
 *
 * The formats are such that every narrowing takes the high word of a sum of products; one factor of each difference is
 * negated once, so that sums accumulate; a number is rounded by bit 31 of the low word. Ranges and bounds are not proved.
 */
#include "by_hand.h"

#define STATE_LIMIT 1140850688u     /* 1.0625 */
#define INCREMENT_LIMIT 599690565u  /* 400 deg/s for 5 ms */
#define FORTY_EIGHTH_NEGATED (-11184811) /* -1/48, times 2^29 */
#define THIRD_NEGATED (-715827883)  /* -1/3, times 2^31 */
#define CUBIC 5592405               /* 1/24, times 2^27 */
#define EIGHTH_NEGATED (-0x10000000) /* -1/8, times 2^31 */

static inline int64_t product(int32_t a, int32_t b)
{
    return (int64_t)a * b;
}

/* The signed word of these bits; as a shift of 64 bits, gcc 12 multiplies numbers of 64 bits afterwards. */
static inline int32_t word(uint32_t bits)
{
    return bits <= (UINT32_MAX >> 1) ? (int32_t)bits : -1 - (int32_t)(UINT32_MAX - bits);
}

/* x / 2^32, downwards. */
static inline int32_t high_word(int64_t x)
{
    return word((uint32_t)((uint64_t)x >> 32));
}

/* x / 2^32, to the nearest. */
static inline int32_t rounded_word(int64_t x)
{
    return word((uint32_t)((uint64_t)x >> 32) + ((uint32_t)x >> 31));
}

static inline int beyond(int32_t x, uint32_t limit)
{
    return (uint32_t)x + limit > 2u * limit;
}

int by_hand(const int32_t state[4], const int32_t increments[6], int32_t next[4])
{
    const int32_t e_x = state[0], e_y = state[1], e_z = state[2], e_s = state[3];
    const int32_t d1_x = increments[0], d1_y = increments[1], d1_z = increments[2];
    const int32_t d2_x = increments[3], d2_y = increments[4], d2_z = increments[5];
    if (beyond(d1_x, INCREMENT_LIMIT) || beyond(d1_y, INCREMENT_LIMIT) || beyond(d1_z, INCREMENT_LIMIT)
        || beyond(d2_x, INCREMENT_LIMIT) || beyond(d2_y, INCREMENT_LIMIT) || beyond(d2_z, INCREMENT_LIMIT))
        return 1;
    if (beyond(e_x, STATE_LIMIT) || beyond(e_y, STATE_LIMIT) || beyond(e_z, STATE_LIMIT) || beyond(e_s, STATE_LIMIT))
        return 1;
    /* sigma, 34 bits of fraction; its square, d1 . d2 and sigma x d1, 36 */
    const int32_t s_x = d1_x + d2_x, s_y = d1_y + d2_y, s_z = d1_z + d2_z;
    const int32_t square = high_word(product(s_x, s_x) + product(s_y, s_y) + product(s_z, s_z));
    const int32_t dot = high_word(product(d1_x, d2_x) + product(d1_y, d2_y) + product(d1_z, d2_z));
    const int32_t c_x = high_word(product(s_y, d1_z) + product(s_z, -d1_y));
    const int32_t c_y = high_word(product(s_z, d1_x) + product(s_x, -d1_z));
    const int32_t c_z = high_word(product(s_x, d1_y) + product(s_y, -d1_x));
    /* the coefficients of sigma, 33 bits without its 1/2, and of the cross product, 31; p twice its value, 35 */
    const int32_t k = high_word(product(square, FORTY_EIGHTH_NEGATED));
    const int32_t w = THIRD_NEGATED - (k >> 2);
    const int32_t p_x = s_x + rounded_word(product(k, s_x) + product(w, c_x));
    const int32_t p_y = s_y + rounded_word(product(k, s_y) + product(w, c_y));
    const int32_t p_z = s_z + rounded_word(product(k, s_z) + product(w, c_z));
    const int32_t f = high_word(product(dot, CUBIC)) - (square >> 12) + EIGHTH_NEGATED;
    const int32_t p_s = rounded_word(product(square, f)); /* less 1 */
    const int32_t q_x = -p_x, q_y = -p_y, q_z = -p_z;
    next[0] = e_x + ((high_word(product(e_s, p_x) + product(e_x, p_s) + product(e_y, p_z) + product(e_z, q_y)) + 4) >> 3);
    next[1] = e_y + ((high_word(product(e_s, p_y) + product(e_x, q_z) + product(e_y, p_s) + product(e_z, p_x)) + 4) >> 3);
    next[2] = e_z + ((high_word(product(e_s, p_z) + product(e_x, p_y) + product(e_y, q_x) + product(e_z, p_s)) + 4) >> 3);
    next[3] = e_s + ((high_word(product(e_s, p_s) + product(e_x, q_x) + product(e_y, q_y) + product(e_z, q_z)) + 4) >> 3);
    return 0;
}
