/* A first-order round of four sweeps over |grad T|_g = slowness, in place; the update of jaxsfs.sweeping. */
#include <math.h>

#define HUGE 1e30f

static float edge(float near, float q, float slowness2)
{
    return near < 0.5f * HUGE ? near + sqrtf(slowness2 / q) : HUGE;
}

static float triangle(float m1, float m2, float h11, float h12, float h22, float slowness2)
{
    if (m1 >= 0.5f * HUGE || m2 >= 0.5f * HUGE)
        return HUGE;
    float gap = m2 - m1, quad = h11 + 2 * h12 + h22, half = (h12 + h22) * gap;
    float discriminant = half * half - quad * (h22 * gap * gap - slowness2);
    if (discriminant < 0)
        return HUGE;
    float d1 = (half + sqrtf(discriminant)) / quad, d2 = d1 - gap;
    if (d1 < 0 || d2 < 0 || h11 * d1 + h12 * d2 < 0 || h12 * d1 + h22 * d2 < 0)
        return HUGE;
    return m1 + d1;
}

/* stride: to the pixel before; side: along the sweep's row; place, length: position in the row and its length */
static void update(float *t, long stride, long side, int place, int length, float g11, float g12, float g22, float p)
{
    float determinant = g11 * g22 - g12 * g12, straight = t[-stride];
    float best = fminf(*t, edge(straight, determinant / g11, p));
    for (int s = -1; s <= 1; s += 2) {
        if (place + s < 0 || place + s >= length)
            continue;
        float diagonal = t[-stride + s * side], h12 = -s * g12 - g11, h11 = g22 + 2 * s * g12 + g11;
        best = fminf(best, edge(diagonal, determinant / h11, p));
        best = fminf(best, triangle(straight, diagonal, h11, h12, g11, p));
    }
    *t = best;
}

void sweep_round(float *t, const float *g11, const float *g12, const float *g22, int height, int width, float slowness)
{
    float p = slowness * slowness;
    for (int i = 1; i < height; i++)
        for (int j = 0; j < width; j++) {
            long k = (long)i * width + j;
            update(t + k, width, 1, j, width, g11[k], g12[k], g22[k], p);
        }
    for (int i = height - 2; i >= 0; i--)
        for (int j = 0; j < width; j++) {
            long k = (long)i * width + j;
            update(t + k, -width, 1, j, width, g11[k], -g12[k], g22[k], p);
        }
    for (int j = 1; j < width; j++)
        for (int i = 0; i < height; i++) {
            long k = (long)i * width + j;
            update(t + k, 1, width, i, height, g22[k], g12[k], g11[k], p);
        }
    for (int j = width - 2; j >= 0; j--)
        for (int i = 0; i < height; i++) {
            long k = (long)i * width + j;
            update(t + k, -1, width, i, height, g22[k], -g12[k], g11[k], p);
        }
}
