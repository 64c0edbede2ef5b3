/* Engagement and mean force of an end mill by brute force (stock_cut.py): each point of the cutter's surface is asked whether
   it stands in material that no earlier step took, and each tooth is put at each angle. Lengths are millimetres, forces newton,
   z is up, the spindle turns clockwise seen from above. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846
#define NONE (-1e9)

typedef struct {                /* rho: how far each tooth stands out by an axis that is `out` aside, at angle `phase` */
    double radius, corner, flute, helix, out, phase, kt, kr, ka, et, er, ea, power, chip0;
    int teeth;
} Cutter;

typedef struct {                /* boxes x0 y0 x1 y1 top; a convex polygon with its top; a net of heights between its points */
    const double *boxes, *corners, *net;
    double polygon_top, net_x, net_y, net_cell;
    int n_boxes, n_corners, nx, ny;
} Stock;

typedef struct { double a[3], b[3], radius, corner; } Way;

typedef struct {                /* of a ball's world: the height of the material, read linearly between the points */
    double *h, x, y, cell;
    int nx, ny;
} Map;

static double stock_top(const Stock *s, double x, double y)
{
    double top = NONE;
    for (int k = 0; k < s->n_boxes; k++) {
        const double *b = s->boxes + 5 * k;
        if (x >= b[0] && x <= b[2] && y >= b[1] && y <= b[3] && b[4] > top) top = b[4];
    }
    if (s->n_corners) {         /* counterclockwise */
        int in = 1;
        for (int k = 0; k < s->n_corners && in; k++) {
            const double *p = s->corners + 2 * k, *q = s->corners + 2 * ((k + 1) % s->n_corners);
            in = (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]) >= 0;
        }
        if (in && s->polygon_top > top) top = s->polygon_top;
    }
    if (s->nx) {
        double u = (x - s->net_x) / s->net_cell, v = (y - s->net_y) / s->net_cell;
        if (u >= 0 && v >= 0 && u <= s->nx - 1 && v <= s->ny - 1) {
            int i = (int)u < s->nx - 2 ? (int)u : s->nx - 2, j = (int)v < s->ny - 2 ? (int)v : s->ny - 2;
            const double *h = s->net + j * s->nx + i;
            u -= i, v -= j;     /* two triangles: 00 10 11 and 00 11 01 */
            double z = u >= v ? h[0] + u * (h[1] - h[0]) + v * (h[s->nx + 1] - h[1])
                              : h[0] + v * (h[s->nx] - h[0]) + u * (h[s->nx + 1] - h[s->nx]);
            if (z > top) top = z;
        }
    }
    return top;
}

/* How high above the tip the cutter's lower side is at a distance d from its axis. */
static double profile(double radius, double corner, double d)
{
    double e = d - (radius - corner);
    return e <= 0 ? 0 : e >= corner ? corner : corner - sqrt(corner * corner - e * e);
}

#define BLOCK 64

/* Earlier ways about the tool, by component. */
typedef struct { double *x, *y, *z, *dx, *dy, *dz, *per, *radius, *corner; int n, flat; } Near;

/* Height to which the ways leave material at x, y; it stops asking where that is under `low`. */
static double left_at(const Stock *s, const Near *w, double x, double y, double low)
{
    double h = stock_top(s, x, y);
    for (int k0 = 0; k0 < w->n && h > low; k0 += BLOCK) {
        int end = k0 + BLOCK < w->n ? k0 + BLOCK : w->n;
        for (int k = k0; k < end; k++) {
            double px = x - w->x[k], py = y - w->y[k], t = (px * w->dx[k] + py * w->dy[k]) * w->per[k];
            t = t < 0 ? 0 : t > 1 ? 1 : t;
            px -= t * w->dx[k], py -= t * w->dy[k];
            double d2 = px * px + py * py, z = w->z[k] + t * w->dz[k], r = w->radius[k] - 1e-5;
            if (!w->flat) z += profile(w->radius[k], w->corner[k], sqrt(d2));
            h = d2 < r * r && z < h ? z : h;
        }
    }
    return h;
}

static double map_at(const Map *m, double x, double y)
{
    double u = (x - m->x) / m->cell, v = (y - m->y) / m->cell;
    if (u < 0 || v < 0 || u >= m->nx - 1 || v >= m->ny - 1) return NONE;
    int i = (int)u, j = (int)v;
    const double *h = m->h + (size_t)j * m->nx + i;
    u -= i, v -= j;
    double a = h[0], b = h[1], c = h[m->nx], d = h[m->nx + 1];
    if (a < -1e8 || b < -1e8 || c < -1e8 || d < -1e8)
        return u < 0.5 ? (v < 0.5 ? a : c) : (v < 0.5 ? b : d);
    return (1 - v) * ((1 - u) * a + u * b) + v * ((1 - u) * c + u * d);
}

/* Lower side of a cutter that went along a way, at x, y: spheres at both ends and the cylinder between, or discs. */
static double lower(const Way *w, double x, double y)
{
    double best = 1e9;
    double ux = w->b[0] - w->a[0], uy = w->b[1] - w->a[1], uz = w->b[2] - w->a[2], l = sqrt(ux * ux + uy * uy + uz * uz);
    for (int e = 0; e < 2; e++) {
        const double *p = e ? w->b : w->a;
        double d = hypot(x - p[0], y - p[1]);
        if (d < w->radius) best = fmin(best, p[2] + profile(w->radius, w->corner, d));
    }
    if (l < 1e-9) return best;
    if (w->corner < w->radius - 1e-9 || ux * ux + uy * uy < 1e-12) {
        double l2 = ux * ux + uy * uy, t = l2 > 1e-18 ? ((x - w->a[0]) * ux + (y - w->a[1]) * uy) / l2 : 0;
        if (t <= 0 || t >= 1) return best;
        double d = hypot(x - w->a[0] - t * ux, y - w->a[1] - t * uy);
        return d < w->radius ? fmin(best, w->a[2] + t * uz + profile(w->radius, w->corner, d)) : best;
    }
    ux /= l, uy /= l, uz /= l;
    double px = x - w->a[0], py = y - w->a[1], g = px * ux + py * uy, q = px * px + py * py;
    /* |p - (p.u) u|^2 = R^2 in z, p measured from the centre at a */
    double A = 1 - uz * uz, B = -2 * g * uz, C = q - g * g - w->radius * w->radius, D = B * B - 4 * A * C;
    if (D > 0) {
        double z = (-B - sqrt(D)) / (2 * A), t = g + z * uz;
        if (t > 0 && t < l) best = fmin(best, w->a[2] + w->radius + z);
    }
    return best;
}

static void stamp(Map *m, const Way *w)
{
    double r = w->radius, low = fmin(w->a[2], w->b[2]);
    int i0 = (int)floor((fmin(w->a[0], w->b[0]) - r - m->x) / m->cell), i1 = (int)ceil((fmax(w->a[0], w->b[0]) + r - m->x) / m->cell);
    int j0 = (int)floor((fmin(w->a[1], w->b[1]) - r - m->y) / m->cell), j1 = (int)ceil((fmax(w->a[1], w->b[1]) + r - m->y) / m->cell);
    i0 = i0 < 0 ? 0 : i0, j0 = j0 < 0 ? 0 : j0, i1 = i1 >= m->nx ? m->nx - 1 : i1, j1 = j1 >= m->ny ? m->ny - 1 : j1;
    for (int j = j0; j <= j1; j++)
        for (int i = i0; i <= i1; i++) {
            double *h = m->h + (size_t)j * m->nx + i;
            if (*h <= low) continue;
            double z = lower(w, m->x + i * m->cell, m->y + j * m->cell);
            if (z < *h) *h = z;
        }
}

typedef struct { double f[3], area, depth; } Sum;

/* All teeth pass one bit of surface: outward normal N, edge's way t, up the meridian u; `share` of a turn, `width` of the edge. */
static void bite(const Cutter *c, Sum *s, const double *N, const double *t, const double *u, double cosine, double feed,
                 double share, double width, double up)
{
    if (cosine <= 0 || width <= 0) return;
    double rho[16], lag = up * tan(c->helix) / c->radius;
    for (int j = 0; j < c->teeth; j++) rho[j] = c->out * cos(2 * PI * j / c->teeth - c->phase - lag);
    for (int j = 0; j < c->teeth; j++) {
        double h = c->teeth * feed * cosine;
        if (c->out > 0)
            for (int k = 1; k < c->teeth; k++)
                h = fmin(h, k * feed * cosine + rho[j] - rho[(j - k + c->teeth) % c->teeth]);
        else h = feed * cosine;
        if (h <= 0) continue;
        double size = c->power > 0 ? pow(h / c->chip0, -c->power) : 1;
        double ft = (c->kt * h * size + c->et) * width * share, fr = (c->kr * h * size + c->er) * width * share;
        double fa = (c->ka * h * size + c->ea) * width * share;
        for (int k = 0; k < 3; k++) s->f[k] -= ft * t[k] + fr * N[k] + fa * u[k];
    }
}

typedef struct {
    const Cutter *c; const Stock *s; const Near *w;
    const double *p, *f; double feed; Sum *sum;
} Here;

static double length_at(const Here *x, double alpha)
{
    double z = x->p[2] + x->c->corner;
    double h = left_at(x->s, x->w, x->p[0] + x->c->radius * cos(alpha), x->p[1] + x->c->radius * sin(alpha), z);
    double l = h - z, most = x->c->flute - x->c->corner;
    return l < 0 ? 0 : l > most ? most : l;
}

/* The flank between two angles; where the depth differs between them the middle is looked at, down to a thousandth of a radian. */
static void flank(const Here *x, double a, double b, double la, double lb)
{
    if (la <= 0 && lb <= 0 && b - a < 0.04) return;
    if (fabs(la - lb) > 0.01 && b - a > 1e-3) {
        double m = (a + b) / 2, lm = length_at(x, m);
        flank(x, a, m, la, lm);
        flank(x, m, b, lm, lb);
        return;
    }
    double alpha = (a + b) / 2, l = (la + lb) / 2, N[3] = {cos(alpha), sin(alpha), 0}, t[3] = {N[1], -N[0], 0}, u[3] = {0, 0, 1};
    double cosine = N[0] * x->f[0] + N[1] * x->f[1];
    if (cosine <= 0 || l <= 0) return;
    int pieces = x->c->out > 0 ? (int)ceil(l) : 1;
    for (int k = 0; k < pieces; k++)
        bite(x->c, x->sum, N, t, u, cosine, x->feed, (b - a) / (2 * PI), l / pieces, x->c->corner + (k + 0.5) * l / pieces);
    x->sum->area += l * cosine * x->c->radius * (b - a);
    if (l + x->c->corner > x->sum->depth) x->sum->depth = l + x->c->corner;
}

/* How much material stands above the rounding's surface at angle kappa from the axis, alpha about it. */
static double above(const Here *x, const Map *m, double kappa, double alpha)
{
    double r = x->c->radius - x->c->corner + x->c->corner * sin(kappa), z = x->p[2] + x->c->corner * (1 - cos(kappa));
    double px = x->p[0] + r * cos(alpha), py = x->p[1] + r * sin(alpha);
    return (m ? map_at(m, px, py) : left_at(x->s, x->w, px, py, z - 0.05)) - z;
}

/* Bits of a rounding or a ball, each a band of which the part that stands in material counts. */
static void rounding(const Here *x, const Map *m, int slices, int around, double rpm, double speed)
{
    const Cutter *c = x->c;
    double step = PI / 2 / slices, ahead = atan2(x->f[1], x->f[0]);
    for (int i = 0; i < around; i++) {
        double alpha = ahead + 2 * PI * (i + 0.5) / around, ca = cos(alpha), sa = sin(alpha);
        if (ca * x->f[0] + sa * x->f[1] <= 0 && x->f[2] >= 0) continue;
        double next = above(x, m, 0, alpha);
        for (int k = 0; k < slices; k++) {
            double kappa = (k + 0.5) * step, sk = sin(kappa), ck = cos(kappa), here = next;
            double r = c->radius - c->corner + c->corner * sk, up = c->corner * (1 - ck);
            double N[3] = {ca * sk, sa * sk, -ck}, u[3] = {ca * ck, sa * ck, sk};
            double cosine = N[0] * x->f[0] + N[1] * x->f[1] + N[2] * x->f[2];
            next = above(x, m, (k + 1) * step, alpha);
            if (cosine <= 0 || (here <= 0 && next <= 0)) continue;
            double in = here > 0 && next > 0 ? 1 : fmax(here, next) / fabs(here - next);
            double v = rpm / 60 * 2 * PI * r, t[3] = {sa * v + speed * x->f[0], -ca * v + speed * x->f[1], speed * x->f[2]};
            double along = t[0] * N[0] + t[1] * N[1] + t[2] * N[2], size = 0;
            for (int j = 0; j < 3; j++) t[j] -= along * N[j], size += t[j] * t[j];
            for (int j = 0; j < 3; j++) t[j] /= sqrt(size);
            bite(c, x->sum, N, t, u, cosine, x->feed, 1.0 / around, in * c->corner * step, up);
            x->sum->area += in * c->corner * step * r * (2 * PI / around) * cosine;
            double deep = fmin(up + fmax(here, next), c->flute);
            if (deep > x->sum->depth) x->sum->depth = deep;
        }
    }
}

static void shank(const Here *x, const Map *m, int around)
{
    const Cutter *c = x->c;
    double layer = c->radius / 8, ahead = atan2(x->f[1], x->f[0]);
    for (int k = 0; c->corner + k * layer < c->flute; k++) {
        int any = 0;
        double up = c->corner + (k + 0.5) * layer;
        for (int i = 0; i < around; i++) {
            double alpha = ahead + 2 * PI * (i + 0.5) / around, N[3] = {cos(alpha), sin(alpha), 0}, t[3] = {N[1], -N[0], 0}, u[3] = {0, 0, 1};
            double h = map_at(m, x->p[0] + c->radius * N[0], x->p[1] + c->radius * N[1]);
            double in = (h - x->p[2] - up + layer / 2) / layer, cosine = N[0] * x->f[0] + N[1] * x->f[1];
            if (in <= 0) continue;
            any = 1;
            if (cosine <= 0) continue;
            if (in > 1) in = 1;
            bite(c, x->sum, N, t, u, cosine, x->feed, 1.0 / around, in * layer, up);
            x->sum->area += in * layer * c->radius * (2 * PI / around) * cosine;
        }
        if (!any) return;
    }
}

/* Drive n steps: place (n, 3) without load, feed's direction (n, 3), speed [mm/s], give (n, 9) [mm/N] about the force at0 with
   the yield give0 there; the cutter's own sweep and `earlier` ways are what no longer stands. Out: force, place, (n, 3), area
   of the chip's cross-section and depth, (n, 2). With `fixed` the place is as given. */
int drive(int n, const double *place, const double *way, const double *speed, const double *give, const double *give0,
          const double *at0, double rpm, const Cutter *c, const Stock *s, int n_earlier, const Way *earlier, double cell,
          double *force, double *out, double *seen)
{
    int ball = c->corner > c->radius - 1e-9;
    Way *w = malloc(sizeof(Way) * (size_t)(n + n_earlier + 1));
    size_t most = (size_t)(n + n_earlier + 1);
    double *room = malloc(9 * sizeof(double) * most);
    Near near = {room, room + most, room + 2 * most, room + 3 * most, room + 4 * most, room + 5 * most, room + 6 * most,
                 room + 7 * most, room + 8 * most, 0, 1};
    int used = 0;
    Map map = {0}, *m = 0;
    if (!w || !room) return 1;
    memcpy(w, earlier, sizeof(Way) * (size_t)n_earlier);
    used = n_earlier;
    double low[2] = {1e9, 1e9}, high[2] = {-1e9, -1e9}, top = NONE;
    for (int k = 0; k < s->n_boxes; k++) {
        const double *b = s->boxes + 5 * k;
        for (int j = 0; j < 2; j++) low[j] = fmin(low[j], b[j]), high[j] = fmax(high[j], b[2 + j]);
        top = fmax(top, b[4]);
    }
    for (int k = 0; k < s->n_corners; k++)
        for (int j = 0; j < 2; j++) low[j] = fmin(low[j], s->corners[2 * k + j]), high[j] = fmax(high[j], s->corners[2 * k + j]);
    if (s->n_corners) top = fmax(top, s->polygon_top);
    if (s->nx) {
        low[0] = fmin(low[0], s->net_x), low[1] = fmin(low[1], s->net_y);
        high[0] = fmax(high[0], s->net_x + (s->nx - 1) * s->net_cell), high[1] = fmax(high[1], s->net_y + (s->ny - 1) * s->net_cell);
        for (int k = 0; k < s->nx * s->ny; k++) top = fmax(top, s->net[k]);
    }
    if (ball) {
        m = &map;
        m->cell = cell, m->x = low[0] - cell, m->y = low[1] - cell;
        m->nx = (int)((high[0] - low[0]) / cell) + 4, m->ny = (int)((high[1] - low[1]) / cell) + 4;
        m->h = malloc(sizeof(double) * (size_t)m->nx * (size_t)m->ny);
        if (!m->h) return 1;
        for (int j = 0; j < m->ny; j++)
            for (int i = 0; i < m->nx; i++) m->h[(size_t)j * m->nx + i] = stock_top(s, m->x + i * cell, m->y + j * cell);
        for (int k = 0; k < n_earlier; k++) stamp(m, w + k);
    }
    double f[3] = {0, 0, 0};
    for (int i = 0; i < n; i++) {
        double p[3];
        Sum sum = {{0, 0, 0}, 0, 0};
        for (int round = 0; round < 60; round++) {
            for (int j = 0; j < 3; j++) {
                p[j] = place[3 * i + j] + give0[3 * i + j];
                for (int k = 0; k < 3; k++) p[j] += give[9 * i + 3 * j + k] * (f[k] - at0[3 * i + k]);
            }
            memset(&sum, 0, sizeof sum);
            double r = c->radius;
            if (p[2] < top && p[0] > low[0] - r && p[0] < high[0] + r && p[1] > low[1] - r && p[1] < high[1] + r) {
                Here x = {c, s, &near, p, way + 3 * i, speed[i] / (rpm / 60 * c->teeth), &sum};
                if (!ball) {
                    near.n = 0, near.flat = 1;
                    for (int k = used - 1; k >= 0; k--) {               /* the latest first: most points are in these */
                        const Way *q = w + k;
                        double reach = r + q->radius;
                        if (fmin(q->a[0], q->b[0]) - reach > p[0] || fmax(q->a[0], q->b[0]) + reach < p[0] ||
                            fmin(q->a[1], q->b[1]) - reach > p[1] || fmax(q->a[1], q->b[1]) + reach < p[1] ||
                            fmin(q->a[2], q->b[2]) > top) continue;
                        double dx = q->b[0] - q->a[0], dy = q->b[1] - q->a[1], l2 = dx * dx + dy * dy;
                        double t = l2 > 1e-12 ? ((p[0] - q->a[0]) * dx + (p[1] - q->a[1]) * dy) / l2 : 0;
                        t = t < 0 ? 0 : t > 1 ? 1 : t;
                        if (hypot(p[0] - q->a[0] - t * dx, p[1] - q->a[1] - t * dy) > reach) continue;
                        int low_end = l2 <= 1e-12 && q->b[2] < q->a[2], j = near.n++;       /* straight down: where it ends */
                        near.x[j] = q->a[0], near.y[j] = q->a[1], near.z[j] = low_end ? q->b[2] : q->a[2];
                        near.dx[j] = dx, near.dy[j] = dy, near.dz[j] = l2 > 1e-12 ? q->b[2] - q->a[2] : 0;
                        near.per[j] = l2 > 1e-12 ? 1 / l2 : 0, near.radius[j] = q->radius, near.corner[j] = q->corner;
                        near.flat &= q->corner <= 0;
                    }
                    double middle = atan2(way[3 * i + 1], way[3 * i]), step = PI / 90, before = length_at(&x, middle - PI / 2);
                    for (int k = 0; k < 90; k++) {
                        double a = middle - PI / 2 + k * step, after = length_at(&x, a + step);
                        flank(&x, a, a + step, before, after);
                        before = after;
                    }
                    if (c->corner > 0) rounding(&x, 0, 6, 240, rpm, speed[i]);
                } else {
                    rounding(&x, m, 40, 152, rpm, speed[i]);
                    shank(&x, m, 152);
                }
            }
            /* a film under a long flute is stiffer than the arm: steps get shorter until both agree */
            double off = 0, part = round < 4 ? 1 : round < 12 ? 0.5 : round < 30 ? 0.2 : 0.07;
            for (int j = 0; j < 3; j++) off += fabs(sum.f[j] - f[j]), f[j] += part * (sum.f[j] - f[j]);
            if (off < 0.1) break;
        }
        memcpy(force + 3 * i, f, sizeof f);
        memcpy(out + 3 * i, p, sizeof p);
        seen[2 * i] = sum.area, seen[2 * i + 1] = sum.depth;
        if (i) {
            Way *q = w + used;
            memcpy(q->a, out + 3 * i - 3, sizeof q->a);
            memcpy(q->b, p, sizeof q->b);
            q->radius = c->radius, q->corner = c->corner;
            if (m) stamp(m, q);
            used++;
        }
    }
    if (m) free(m->h);
    free(w), free(room);
    return 0;
}
