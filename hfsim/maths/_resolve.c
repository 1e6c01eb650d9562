/* Linear equations, modes of symmetric matrices and orthonormal bases, for tapes (_replay.c).
 *
 * All is done along columns, or rows, of whole vectors: they end with zeros, and where they begin later they begin
 * with zeros, so that nothing is left over.  Complex ones are vectors of real parts and then of imaginary ones.
 */
#include "_replay.h"
#include <float.h>
#include <math.h>
#include <string.h>

#define W 4         /* numbers in a vector */
#define SIDE 4      /* columns that are solved for side by side */
#define TINY 1e-280 /* squares of numbers that are nothing beside 1 */
#define SWEEPS 30   /* for an eigenvalue at most, as in LAPACK */
typedef double vec __attribute__((vector_size(32), aligned(8)));
#define ALWAYS static inline __attribute__((always_inline))

static inline i64 vectors(i64 n) { return (n + W - 1) / W; }

/* ---------------------------------------------------------------- linear equations */

/* What is kept of a matrix that is taken apart without moving its rows: its factors column by column, the upper one
 * with rows in the order of pivots, their inverses, and this order. */
typedef struct { i64 n, m, column; vec *lower, *upper, *inverse; i64 *order; } Factor;

static inline Factor factor_at(char *at, i64 n, int parts) {
    const i64 m = vectors(n), column = parts * m;
    vec *lower = (vec *)at, *upper = lower + n * column, *inverse = upper + n * column;
    return (Factor){n, m, column, lower, upper, inverse, (i64 *)(inverse + column)};
}

/* x -= f y in the first vectors */
ALWAYS void less(vec *x, const vec *y, double re, double im, i64 count, i64 m, const int parts) {
    for (i64 i = 0; i < count; i++) {
        if (parts == 1) x[i] -= re * y[i];
        else {
            const vec u = y[i], v = y[m + i];
            x[i] = x[i] - re * u + im * v;
            x[m + i] = x[m + i] - re * v - im * u;
        }
    }
}

/* Choose the pivot of a column, the largest of the rows that are left; return its row, -1 if all are zero. */
ALWAYS i64 pivot(Factor f, i64 c, double *spare, const int parts) {
    const i64 n = f.n, to = W * f.m;
    double *u = (double *)(f.upper + c * f.column), *v = u + to, *l = (double *)(f.lower + c * f.column);
    double *inverse = (double *)f.inverse, most = 0.0, re, im = 0.0;
    i64 best = -1, k;
    for (k = c; k < n; k++) {
        const i64 r = f.order[k];
        const double size = fabs(u[r]) + (parts == 2 ? fabs(v[r]) : 0.0);
        if (!(size <= most)) { most = size; best = k; }
    }
    if (best < 0) return -1;
    const i64 p = f.order[best];
    f.order[best] = f.order[c]; f.order[c] = p;
    re = 1.0 / u[p];
    if (parts == 2) {
        const double unit = 1.0 / most, x = u[p] * unit, y = v[p] * unit, size = 1.0 / (x * x + y * y);
        re = x * size * unit; im = -y * size * unit;
        inverse[to + c] = im;
    }
    inverse[c] = re;
    for (k = c + 1; k < n; k++) {
        const i64 r = f.order[k];
        if (parts == 1) l[r] = u[r] * re;
        else { l[r] = u[r] * re - v[r] * im; l[to + r] = u[r] * im + v[r] * re; }
    }
    for (int part = 0; part < parts; part++, u += to) { /* above it, in the order of pivots */
        for (k = 0; k < c; k++) spare[k] = u[f.order[k]];
        memset(u, 0, to * 8);
        memcpy(u, spare, c * 8);
    }
    return p;
}

/* Eliminate by two pivots at once. */
ALWAYS int factorise(Factor f, const char *a, const i64 *step, double *spare, const int parts) {
    const i64 n = f.n, m = f.m, to = W * m;
    i64 p = 0, before = 0;
    memset(f.lower, 0, (char *)f.order - (char *)f.lower);
    for (i64 j = 0; j < n; j++) {
        double *u = (double *)(f.upper + j * f.column);
        for (i64 i = 0; i < n; i++) {
            const double *x = (const double *)(a + i * step[0] + j * step[1]);
            u[i] = x[0];
            if (parts == 2) u[to + i] = x[1];
        }
        f.order[j] = j;
    }
    for (i64 c = 0; c < n; c++, before = p) {
        vec *y = f.lower + c * f.column, *z = y - f.column, *x = f.upper + (c + 1) * f.column;
        if ((p = pivot(f, c, spare, parts)) < 0) return 1;
        if (c % 2 == 0) {
            const double *u = (double *)x;
            if (c + 1 < n) less(x, y, u[p], parts == 2 ? u[to + p] : 0.0, m, m, parts);
            continue;
        }
        const double *l = (double *)z, g = l[p], h = parts == 2 ? l[to + p] : 0.0;
        for (i64 j = c + 1; j < n; j++, x += f.column) {
            const double *u = (double *)x, r = u[before], s = parts == 2 ? u[to + before] : 0.0;
            const double re = u[p] - g * r + h * s, im = parts == 2 ? u[to + p] - g * s - h * r : 0.0;
            for (i64 i = 0; i < m; i++) {
                if (parts == 1) x[i] = x[i] - r * z[i] - re * y[i];
                else {
                    const vec q = z[i], t = z[m + i], v = y[i], w = y[m + i];
                    x[i] = x[i] - r * q + s * t - re * v + im * w;
                    x[m + i] = x[m + i] - r * t - s * q - re * w - im * v;
                }
            }
        }
    }
    return 0;
}

/* Solve for some columns side by side, none of which waits for its last step then. */
ALWAYS void substitute(Factor f, char *out, const i64 *so, const char *b, const i64 *sb, i64 count, double *spare, const int parts) {
    const i64 n = f.n, m = f.m, to = W * m, one = 2 * parts * to;
    const double *inverse = (const double *)f.inverse;
    memset(spare, 0, count * one * 8);
    for (i64 q = 0; q < count; q++)
        for (i64 i = 0; i < n; i++)
            for (int part = 0; part < parts; part++)
                spare[q * one + part * to + i] = ((const double *)(b + i * sb[0] + q * sb[1]))[part];
    for (i64 c = 0; c < n; c++)
        for (i64 q = 0; q < count; q++) {
            double *x = spare + q * one, *z = x + parts * to;
            const double re = z[c] = x[f.order[c]], im = parts == 2 ? z[to + c] = x[to + f.order[c]] : 0.0;
            if (re != 0.0 || im != 0.0) less((vec *)x, f.lower + c * f.column, re, im, m, m, parts);
        }
    for (i64 c = n - 1; c >= 0; c--)
        for (i64 q = 0; q < count; q++) {
            double *z = spare + q * one + parts * to, *found = (double *)(out + c * so[0] + q * so[1]);
            double re = z[c] * inverse[c], im = 0.0;
            if (parts == 2) {
                im = z[c] * inverse[to + c] + z[to + c] * inverse[c];
                re -= z[to + c] * inverse[to + c];
                found[1] = im;
            }
            found[0] = re;
            less((vec *)z, f.upper + c * f.column, re, im, vectors(c), m, parts);
        }
}

/* A real one of at most FEW rows, in numbers by themselves: its factors, inverses of pivots and their order. */
#define FEW 4
#define UNROLL _Pragma("GCC unroll 4")
ALWAYS int factor_few(double *out, const char *a, const i64 *step, const int n) {
    double x[FEW][FEW + 1]; /* and which row it was */
    UNROLL for (int i = 0; i < n; i++) {
        UNROLL for (int j = 0; j < n; j++) x[i][j] = *(const double *)(a + i * step[0] + j * step[1]);
        x[i][n] = i;
    }
    UNROLL for (int c = 0; c < n; c++) {
        UNROLL for (int r = c + 1; r < n; r++) {
            const int larger = !(fabs(x[r][c]) <= fabs(x[c][c]));
            UNROLL for (int j = 0; j <= n; j++) {
                const double u = x[c][j], v = x[r][j];
                x[c][j] = larger ? v : u; x[r][j] = larger ? u : v;
            }
        }
        if (x[c][c] == 0.0) return 1;
        x[c][c] = 1.0 / x[c][c];
        UNROLL for (int r = c + 1; r < n; r++) {
            x[r][c] *= x[c][c];
            UNROLL for (int j = c + 1; j < n; j++) x[r][j] -= x[r][c] * x[c][j];
        }
    }
    UNROLL for (int i = 0; i < n; i++) UNROLL for (int j = 0; j <= n; j++) out[i * (n + 1) + j] = x[i][j];
    return 0;
}

ALWAYS int solve_few(const double *f, char *out, const i64 *so, const char *b, const i64 *sb, i64 count, const int n) {
    for (; count; count--, out += so[1], b += sb[1]) {
        double x[FEW];
        UNROLL for (int i = 0; i < n; i++) {
            x[i] = *(const double *)(b + (i64)f[i * (n + 1) + n] * sb[0]);
            UNROLL for (int j = 0; j < i; j++) x[i] -= f[i * (n + 1) + j] * x[j];
        }
        UNROLL for (int i = n - 1; i >= 0; i--) {
            UNROLL for (int j = i + 1; j < n; j++) x[i] -= f[i * (n + 1) + j] * x[j];
            x[i] *= f[i * (n + 1) + i];
            *(double *)(out + i * so[0]) = x[i];
        }
    }
    return 0;
}

#define SOME(DO, N) case N: { const int n = N; return DO; }
#define IF_FEW(DO) switch (o->more == 1 ? f.n : 0) { SOME(DO, 1) SOME(DO, 2) SOME(DO, 3) SOME(DO, FEW) }
WIDE static int factor(const Op *o, char *out, const char *a, const char *none, double *spare) {
    const Factor f = factor_at(out, o->shape[0], (int)o->more);
    IF_FEW(factor_few((double *)out, a, o->step[1], n))
    return o->more == 2 ? factorise(f, a, o->step[1], spare, 2) : factorise(f, a, o->step[1], spare, 1);
}

WIDE static int solve(const Op *o, char *out, const char *a, const char *b, double *spare) {
    const Factor f = factor_at((char *)a, o->shape[0], (int)o->more);
    const i64 k = o->shape[1], *so = o->step[0], *sb = o->step[2];
    IF_FEW(solve_few((const double *)a, out, so, b, sb, k, n))
    for (i64 j = 0; j < k; j += SIDE, out += SIDE * so[1], b += SIDE * sb[1]) {
        const i64 count = k - j < SIDE ? k - j : SIDE;
        if (o->more == 2) substitute(f, out, so, b, sb, count, spare, 2);
        else substitute(f, out, so, b, sb, count, spare, 1);
    }
    return 0;
}

/* ---------------------------------------------------------------- reflections */

ALWAYS double dot(const vec *x, const vec *y, i64 first, i64 m) {
    vec sum = {0};
    for (i64 j = first; j < m; j++) sum += x[j] * y[j];
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/* Make of x the vector v of a reflection 1 - weight v v^T that leaves of x from an entry on only this entry, and zero
 * what is before it; return the weight. */
ALWAYS double reflection(vec *x, i64 first, i64 m, double *left) {
    double *v = (double *)x;
    const double head = *left = v[first];
    memset(v, 0, (first + 1) * 8);
    const double tail = dot(x, x, first / W, m), all = head * head + tail, size = sqrt(all);
    if (tail < TINY) return 0.0;
    *left = head > 0.0 ? -size : size;
    v[first] = head - *left;
    return 1.0 / (all - head * *left);
}

/* Put the product of reflections, of which the k-th begins at k + shift, into the rows of a square matrix. */
ALWAYS void product(i64 n, i64 m, i64 count, i64 shift, const vec *v, const double *weight, vec *rows, vec *sum) {
    memset(rows, 0, n * m * sizeof(vec));
    for (i64 i = 0; i < n; i++) ((double *)(rows + i * m))[i] = 1.0;
    for (i64 k = count - 1; k >= 0; k--) {
        const i64 begin = k + shift, first = begin / W;
        const vec *x = v + k * m;
        const double *y = (const double *)x;
        if (weight[k] == 0.0) continue;
        for (i64 j = first; j < m; j++) sum[j] = (vec){0};
        for (i64 i = begin; i < n; i++) {
            const double f = weight[k] * y[i];
            for (i64 j = first; j < m; j++) sum[j] += f * rows[i * m + j];
        }
        for (i64 i = begin; i < n; i++) {
            const double f = y[i];
            for (i64 j = first; j < m; j++) rows[i * m + j] -= f * sum[j];
        }
    }
}

/* out: an orthonormal basis of which the first columns are those of a, as far as they are independent */
WIDE static int basis(const Op *o, char *out, const char *a, const char *none, double *spare) {
    const i64 n = o->shape[0], k = o->shape[1], m = vectors(n), count = n < k ? n : k, *so = o->step[0], *sa = o->step[1];
    vec *v = (vec *)spare, *rows = v + k * m, *sum = rows + n * m;
    double *weight = (double *)(sum + m);
    memset(v, 0, k * m * sizeof(vec));
    for (i64 j = 0; j < k; j++)
        for (i64 i = 0; i < n; i++) ((double *)(v + j * m))[i] = *(const double *)(a + i * sa[0] + j * sa[1]);
    for (i64 c = 0; c < count; c++) {
        double left;
        weight[c] = reflection(v + c * m, c, m, &left);
        for (i64 j = c + 1; j < k; j++) {
            vec *x = v + j * m;
            less(x, v + c * m, weight[c] * dot(x, v + c * m, c / W, m), 0.0, m, m, 1);
        }
    }
    product(n, m, count, 0, v, weight, rows, sum);
    for (i64 i = 0; i < n; i++)
        for (i64 j = 0; j < n; j++) *(double *)(out + i * so[0] + j * so[1]) = ((double *)(rows + i * m))[j];
    return 0;
}

/* ---------------------------------------------------------------- symmetric matrices */

/* Make a symmetric matrix tridiagonal: d and, beside it, e; its rows become reflections. */
ALWAYS void tridiagonal(i64 n, i64 m, vec *rows, double *weight, double *d, double *e, vec *sum) {
    double *p = (double *)sum;
    for (i64 k = 0; k < n; k++) {
        vec *v = rows + k * m;
        const double *x = (const double *)v;
        const i64 first = (k + 1) / W;
        d[k] = x[k]; e[k] = 0.0; weight[k] = 0.0;
        if (k + 1 < n) e[k] = x[k + 1];
        if (k + 2 >= n) continue;
        const double w = weight[k] = reflection(v, k + 1, m, &e[k]);
        if (w == 0.0) continue;
        for (i64 j = first; j < m; j++) sum[j] = (vec){0};
        for (i64 i = k + 1; i < n; i++) {
            const vec *a = rows + i * m;
            const double f = w * x[i];
            for (i64 j = first; j < m; j++) sum[j] += f * a[j];
        }
        for (i64 j = first * W; j <= k; j++) p[j] = 0.0;
        const double part = 0.5 * w * dot(sum, v, first, m);
        for (i64 j = first; j < m; j++) sum[j] -= part * v[j];
        for (i64 i = k + 1; i < n; i++) {
            vec *a = rows + i * m;
            const double f = x[i], g = p[i];
            for (i64 j = first; j < m; j++) a[j] = a[j] - f * sum[j] - g * v[j];
        }
    }
}

/* Make a tridiagonal matrix diagonal by rotations, implicit QL with shifts, and turn rows of a matrix along. */
ALWAYS int diagonal(i64 n, i64 m, double *d, double *e, vec *rows) {
    for (i64 l = 0; l < n; l++) for (int sweep = 0;; sweep++) {
        i64 end = l, i;
        while (end < n - 1 && !(fabs(e[end]) <= 0.5 * DBL_EPSILON * (fabs(d[end]) + fabs(d[end + 1]) + 1.0))) end++;
        if (end == l) break;
        if (sweep == SWEEPS) return 1;
        double g = (d[l + 1] - d[l]) / (2.0 * e[l]), s = 1.0, c = 1.0, p = 0.0;
        g = d[end] - d[l] + e[l] / (g + copysign(sqrt(g * g + 1.0), g));
        for (i = end - 1; i >= l; i--) {
            const double f = s * e[i], b = c * e[i], square = f * f + g * g;
            if (square < TINY) { d[i + 1] -= p; e[i + 1] = e[end] = 0.0; break; }
            /* the next g does not wait for the square root */
            const double inverse = 1.0 / square, size = sqrt(square);
            const double before = d[i + 1] - p, r = f * (d[i] - before) + 2.0 * g * b;
            s = f * (size * inverse); c = g * (size * inverse);
            p = f * r * inverse;
            g = g * r * inverse - b;
            d[i + 1] = before + p; e[i + 1] = size;
            vec *x = rows + i * m, *y = x + m;
            for (i64 j = 0; j < m; j++) {
                const vec u = x[j], v = y[j];
                y[j] = s * u + c * v;
                x[j] = c * u - s * v;
            }
        }
        if (i >= l) continue;
        d[l] -= p; e[l] = g; e[end] = 0.0;
    }
    return 0;
}

/* out: a row of eigenvalues from the lowest up, and a row for each eigenvector */
WIDE static int modes(const Op *o, char *out, const char *a, const char *none, double *spare) {
    const i64 n = o->shape[0], m = vectors(n), wide = W * m, *so = o->step[0], *sa = o->step[1];
    vec *rows = (vec *)spare, *turns = rows + n * m, *sum = turns + n * m;
    double *x = (double *)rows, *d = (double *)(sum + m), *e = d + wide, *weight = e + wide, most = 0.0;
    i64 *order = (i64 *)weight;
    int power = 0;
    memset(rows, 0, n * m * sizeof(vec));
    for (i64 i = 0; i < n; i++)
        for (i64 j = 0; j <= i; j++) {
            const double one = *(const double *)(a + i * sa[0] + j * sa[1]);
            x[i * wide + j] = x[j * wide + i] = one;
            if (!(fabs(one) <= most)) most = fabs(one);
        }
    if (!(most <= DBL_MAX)) return 1;
    frexp(most, &power);
    if (power < -1000) power = -1000;
    const double unit = ldexp(1.0, -power), back = ldexp(1.0, power);
    for (i64 j = 0; j < n * m; j++) rows[j] *= unit;
    tridiagonal(n, m, rows, weight, d, e, sum);
    product(n, m, n - 2, 1, rows, weight, turns, sum);
    for (i64 i = 0; i < n; i++) for (i64 j = 0; j < n; j++) x[i * wide + j] = ((double *)turns)[j * wide + i];
    if (diagonal(n, m, d, e, rows)) return 1;
    for (i64 k = 0; k < n; k++) order[k] = k;
    for (i64 k = 0; k < n; k++) { /* few are out of order */
        i64 i = k, row = order[k];
        const double value = d[k];
        for (; i > 0 && d[i - 1] > value; i--) { d[i] = d[i - 1]; order[i] = order[i - 1]; }
        d[i] = value; order[i] = row;
    }
    for (i64 k = 0; k < n; k++) {
        *(double *)(out + k * so[1]) = d[k] * back;
        for (i64 j = 0; j < n; j++) *(double *)(out + (k + 1) * so[0] + j * so[1]) = x[order[k] * wide + j];
    }
    return 0;
}

/* ---------------------------------------------------------------- operations */

/* shape: rows and columns of what is read last, batch, batch; steps: (i, j, batch, batch) */
int resolve(const Op *o) {
    static int (*const DO[])(const Op *, char *, const char *, const char *, double *) = {factor, solve, basis, modes};
    const i64 *n = o->shape, m = W * vectors(n[0]);
    double *spare = workspace((n[0] + n[1] + 4 * SIDE) * m);
    if (!spare) return -1;
    for (i64 p = 0; p < n[2]; p++) for (i64 q = 0; q < n[3]; q++) {
        char *at[3];
        for (int k = 0; k < 3; k++) at[k] = o->at[k] + p * o->step[k][2] + q * o->step[k][3];
        if (DO[o->code - factor_code](o, at[0], at[1], at[2], spare)) return 1;
    }
    return 0;
}
