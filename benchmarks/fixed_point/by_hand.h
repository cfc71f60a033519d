/* The classical fourth-order Runge-Kutta step of Euler parameters on two angle increments, in 32-bit
 * fixed point, written by hand: for rates of up to 400 deg/s on an axis and steps of 10 ms.
 *
 * state, next: Euler parameters, scalar last, times 2^30; at most 1.0625 in magnitude.
 * increments: angle increments in rad, times 2^34; at most 599690565 in magnitude.
 * Returns 0; or 1 with `next` left alone, if an input is out of range.
 */
#ifndef BY_HAND_H
#define BY_HAND_H

#include <stdint.h>

int by_hand(const int32_t state[4], const int32_t increments[6], int32_t next[4]);

#endif
