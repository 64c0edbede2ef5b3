/* The practical limit of the kernel (kernel.py): the same arithmetic in C, components first, LANES poses at a time, each line a
   loop over these, which a compiler turns into vector instructions. n is a multiple of LANES. */

#include <math.h>

#define JOINTS 6
#define LANES 64
#define EACH for (int k = 0; k < LANES; k++)

/* Of each joint sine and cosine of alpha, a and d [m]; the TCP in the flange frame [m]; soft (6, 6) [rad/(N m)] turns torques
   about the serial axes into angles of these. */
typedef struct {
    double sine[JOINTS], cosine[JOINTS], a[JOINTS], d[JOINTS], tcp[3], soft[JOINTS][JOINTS];
} Arm;
typedef double Lanes[LANES];

/* Inwards from the tool: the TCP seen from each joint's frame, across its axis in x and y, and from the base in p. */
static void lever_arms(const Arm *arm, Lanes *s, Lanes *c, Lanes *x, Lanes *y, Lanes *p)
{
    EACH p[0][k] = arm->tcp[0], p[1][k] = arm->tcp[1], p[2][k] = arm->tcp[2];
    for (int i = JOINTS - 1; i >= 0; i--) {
        double sine = arm->sine[i], cosine = arm->cosine[i], a = arm->a[i], d = arm->d[i];
        EACH {
            double u = c[i][k] * p[0][k] - s[i][k] * p[1][k], v = s[i][k] * p[0][k] + c[i][k] * p[1][k], w = p[2][k] + d;
            x[i][k] = u, y[i][k] = v;
            p[0][k] = u + a, p[1][k] = cosine * v - sine * w, p[2][k] = sine * v + cosine * w;
        }
    }
}

/* Outwards from the base: torques (6) about the serial axes of forces f, which are lost. */
static void torques(const Arm *arm, Lanes *s, Lanes *c, Lanes *x, Lanes *y, Lanes *f, Lanes *torque)
{
    for (int i = 0; i < JOINTS; i++) {
        double sine = arm->sine[i], cosine = arm->cosine[i];
        EACH {
            double u = f[0][k], v = cosine * f[1][k] + sine * f[2][k], w = cosine * f[2][k] - sine * f[1][k];
            torque[i][k] = x[i][k] * v - y[i][k] * u;
            f[0][k] = c[i][k] * u + s[i][k] * v, f[1][k] = c[i][k] * v - s[i][k] * u, f[2][k] = w;
        }
    }
}

/* Deviation (3, n) [m] of the TCP at serial angles theta (6, n) [rad] under forces (3, n) [N], base frame, after so many
   evaluations of the torque. */
void deviation(long n, int rounds, const Arm *arm, const double *theta, const double *force, double *out)
{
    for (long at = 0; at < n; at += LANES) {
        Lanes s[JOINTS], c[JOINTS], x[JOINTS], y[JOINTS], torque[JOINTS], angle, before[3], p[3], f[3];
        for (int i = 0; i < JOINTS; i++) {
            const double *planned = theta + i * n + at;
            EACH s[i][k] = sin(planned[k]);
            EACH c[i][k] = cos(planned[k]);
        }
        lever_arms(arm, s, c, x, y, before);
        for (int round = 0; round < rounds; round++) {
            for (int i = 0; i < 3; i++)
                EACH f[i][k] = force[i * n + at + k];
            torques(arm, s, c, x, y, f, torque);
            for (int i = 0; i < JOINTS; i++) {
                EACH angle[k] = theta[i * n + at + k];
                for (int j = 0; j < JOINTS; j++)
                    if (arm->soft[i][j] != 0)
                        EACH angle[k] += arm->soft[i][j] * torque[j][k];
                EACH s[i][k] = sin(angle[k]);
                EACH c[i][k] = cos(angle[k]);
            }
            lever_arms(arm, s, c, x, y, p);
        }
        for (int i = 0; i < 3; i++)
            EACH out[i * n + at + k] = p[i][k] - before[i][k];
    }
}

/* Serial angles (6, n) [rad] of flange poses, rotation (9, n) row by row and position (3, n) [m]: the wrist centre in front of
   axis 1 and of the lower arm, axis 5 positive, of an arm with the twists of the IRB 6660: 0, -90, 0, -90, 90, -90 degrees. */
void branch(long n, const Arm *arm, const double *rotation, const double *position, double *theta)
{
    const double upper = arm->a[2], fore = sqrt(arm->a[3] * arm->a[3] + arm->d[3] * arm->d[3]);
    const double bend = atan2(arm->d[3], arm->a[3]);
    for (long at = 0; at < n; at += LANES) {
        const double *r = rotation + at, *p = position + at;
        double *q = theta + at;
        Lanes u, v, c1, s1, c2, s2, wx[3], wy[3], wz;
        EACH u[k] = p[k] - arm->d[5] * r[2 * n + k], v[k] = p[n + k] - arm->d[5] * r[5 * n + k];
        EACH q[k] = atan2(v[k], u[k]);
        EACH u[k] = sqrt(u[k] * u[k] + v[k] * v[k]) - arm->a[1], v[k] = arm->d[0] + arm->d[5] * r[8 * n + k] - p[2 * n + k];
        EACH {
            double fold = (u[k] * u[k] + v[k] * v[k] - upper * upper - fore * fore) / (2 * upper * fore);
            wx[0][k] = fmax(fmin(fold, 1), -1);
        }
        EACH q[2 * n + k] = acos(wx[0][k]);
        EACH wy[0][k] = atan2(fore * sqrt((1 - wx[0][k]) * (1 + wx[0][k])), upper + fore * wx[0][k]);
        EACH q[n + k] = atan2(v[k], u[k]) - wy[0][k];
        EACH q[2 * n + k] -= bend;
        EACH c1[k] = cos(q[k]);
        EACH s1[k] = sin(q[k]);
        EACH c2[k] = cos(q[n + k] + q[2 * n + k]);
        EACH s2[k] = sin(q[n + k] + q[2 * n + k]);
        for (int i = 0; i < 3; i++)         /* the flange's axes where the forearm points along z */
            EACH {
                double a = c1[k] * r[i * n + k] + s1[k] * r[(3 + i) * n + k];
                wx[i][k] = c2[k] * a - s2[k] * r[(6 + i) * n + k], wy[i][k] = s1[k] * r[i * n + k] - c1[k] * r[(3 + i) * n + k];
                wz[k] = -(c2[k] * r[(6 + i) * n + k] + s2[k] * a);
            }
        EACH q[3 * n + k] = atan2(-wy[2][k], -wx[2][k]);
        EACH q[4 * n + k] = atan2(sqrt(wx[2][k] * wx[2][k] + wy[2][k] * wy[2][k]), wz[k]);
        EACH c1[k] = cos(q[3 * n + k]);
        EACH s1[k] = sin(q[3 * n + k]);
        EACH u[k] = c1[k] * wy[0][k] - s1[k] * wx[0][k], v[k] = c1[k] * wy[1][k] - s1[k] * wx[1][k];
        EACH q[5 * n + k] = atan2(u[k], v[k]);
    }
}
