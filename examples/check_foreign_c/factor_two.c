/* Attitude from the delta angles of a gyro, one sample a call, with a fault.
 *
 * The coning correction is divided by 6 in place of 12: it is twice as large as it should be.
 * The quaternion is body to reference, scalar first; correct.c is the same without the fault.
 */
#include <math.h>

static double previous[3];

static void cross(const double a[3], const double b[3], double c[3])
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

/* Turn q by the rotation vector v, and bring it back to length 1. */
static void rotate(double q[4], const double v[3])
{
    const double square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    const double angle = sqrt(square);
    /* sin(angle / 2) / angle, by its series where the angle is small */
    const double s = angle > 1e-3 ? sin(0.5 * angle) / angle : 0.5 - square / 48.0;
    const double w = cos(0.5 * angle), x = s * v[0], y = s * v[1], z = s * v[2];
    const double r[4] = {
        q[0] * w - q[1] * x - q[2] * y - q[3] * z,
        q[0] * x + q[1] * w + q[2] * z - q[3] * y,
        q[0] * y - q[1] * z + q[2] * w + q[3] * x,
        q[0] * z + q[1] * y - q[2] * x + q[3] * w,
    };
    const double length = sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3]);
    for (int i = 0; i < 4; i++) {
        q[i] = r[i] / length;
    }
}

void integrator_init(void)
{
    for (int i = 0; i < 3; i++) {
        previous[i] = 0.0;
    }
}

void integrator_update(double q[4], const double delta_angle[3])
{
    double coning[3], v[3];
    cross(previous, delta_angle, coning);
    for (int i = 0; i < 3; i++) {
        v[i] = delta_angle[i] + coning[i] / 6.0;
        previous[i] = delta_angle[i];
    }
    rotate(q, v);
}
