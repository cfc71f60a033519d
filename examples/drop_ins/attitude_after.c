/* The same interface around generated code, which has the scalar last and takes the increments in one array. */
#include "euler_coning_compressed_2_float.h"

#include <string.h>

void attitude_update(float q[4], const float delta_angles[2][3])
{
    float state[4] = {q[1], q[2], q[3], q[0]};
    float increments[6];

    (void)memcpy(increments, delta_angles, sizeof increments);
    euler_coning_compressed_2_float(state, increments, state);
    q[0] = state[3];
    (void)memcpy(q + 1, state, 3 * sizeof *q);
}
