/* Turns an attitude, scalar first, by the sum of two delta angles: the common kind, without a coning correction. */
#include <math.h>

void attitude_update(float q[4], const float delta_angles[2][3])
{
    const float x = delta_angles[0][0] + delta_angles[1][0];
    const float y = delta_angles[0][1] + delta_angles[1][1];
    const float z = delta_angles[0][2] + delta_angles[1][2];
    const float angle = sqrtf(x * x + y * y + z * z);
    const float k = angle > 1e-6F ? sinf(0.5F * angle) / angle : 0.5F;
    const float c = cosf(0.5F * angle);
    const float a = q[0], b = q[1], d = q[2], e = q[3];

    q[0] = c * a - k * (x * b + y * d + z * e);
    q[1] = c * b + k * (x * a + z * d - y * e);
    q[2] = c * d + k * (y * a + x * e - z * b);
    q[3] = c * e + k * (z * a + y * b - x * d);
}
