/* Replays tapes of array operations (hfsim/maths/tape.py).  No Python object is touched but by CALL. */
#include "_replay.h"
#include <complex.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#ifndef SOURCE
#define SOURCE 0 /* checksum of these files, by which a kernel that was built from others is told apart */
#endif
#if !defined(CMPLX) && defined(__clang__)
#define CMPLX(x, y) ((double complex){x, y})
#endif
typedef double complex cplx;
typedef double num_d; /* what the kinds of _replay.h stand for */
typedef cplx num_D;
typedef char num_b;

#define UNROLL _Pragma("GCC unroll 8")
#define IVDEP _Pragma("GCC ivdep")

/* n entries of several rows: for each operand an address, and steps within a row and between rows */
typedef void (*Inner)(char **at, const i64 *step, const i64 *row, i64 n, i64 rows);

/* ---------------------------------------------------------------- elementwise: out, a, b */

#define AT(T, k, i) (*(T *)(at[k] + (i) * step[k]))
#define ROWS_OF(NAME, OPERANDS, ...)                                                                         \
    WIDE static void NAME(char **at, const i64 *step, const i64 *row, i64 n, i64 rows) {                     \
        for (i64 i; rows; rows--) {                                                                          \
            __VA_ARGS__                                                                                      \
            for (int k = 0; k < OPERANDS; k++) at[k] += row[k];                                              \
        }                                                                                                    \
    }
/* what a function of _replay.h finds one after another, from p and q to o, at steps that the compiler knows where they
 * are constants; T is the type that is written, F the one that is read */
#define GET(T, p, step) (*(const T *)((p) + i * (step)))
#define EACH(STEP, VALUE) for (i = 0; i < n; i++) *(T *)(o + i * (STEP)) = VALUE;
#define BINARY(NAME, TO, FROM, EXPR)                                                                         \
    static inline num_##TO NAME##_of(num_##FROM a, num_##FROM b) { return EXPR; }                            \
    ROWS_OF(NAME, 3,                                                                                         \
        typedef num_##TO T; typedef num_##FROM F;                                                            \
        char *o = at[0]; const char *p = at[1]; const char *q = at[2];                                       \
        const int plain = step[0] == sizeof(T), first = step[1] == sizeof(F), second = step[2] == sizeof(F); \
        if (plain && first && second) IVDEP EACH(sizeof(T), NAME##_of(GET(F, p, sizeof(F)), GET(F, q, sizeof(F)))) \
        else if (plain && first && !step[2]) IVDEP EACH(sizeof(T), NAME##_of(GET(F, p, sizeof(F)), *(const F *)q)) \
        else if (plain && !step[1] && second) IVDEP EACH(sizeof(T), NAME##_of(*(const F *)p, GET(F, q, sizeof(F)))) \
        else EACH(step[0], NAME##_of(GET(F, p, step[1]), GET(F, q, step[2]))))
#define UNARY(NAME, TO, FROM, EXPR)                                                                          \
    static inline num_##TO NAME##_of(num_##FROM a) { return EXPR; }                                          \
    ROWS_OF(NAME, 2,                                                                                         \
        typedef num_##TO T; typedef num_##FROM F;                                                            \
        char *o = at[0]; const char *p = at[1];                                                              \
        const int plain = step[0] == sizeof(T);                                                              \
        if (plain && step[1] == sizeof(F)) IVDEP EACH(sizeof(T), NAME##_of(GET(F, p, sizeof(F))))            \
        else if (plain && step[1] == 2 * sizeof(F)) IVDEP EACH(sizeof(T), NAME##_of(GET(F, p, 2 * sizeof(F)))) \
        else if (plain && !step[1]) { const T all = NAME##_of(*(const F *)p); EACH(sizeof(T), all) }         \
        else EACH(step[0], NAME##_of(GET(F, p, step[1]))))
/* out op= a, where out may stand still: then several partial results, which do not wait for one another */
#define LANES 32
#define REDUCE(NAME, TO, FROM, EXPR)                                                                         \
    static inline num_##TO NAME##_of(num_##TO r, num_##FROM a) { return EXPR; }                              \
    ROWS_OF(NAME, 2,                                                                                         \
        typedef num_##TO T;                                                                                  \
        char *o = at[0]; const char *p = at[1];                                                              \
        if (step[0] == 0 && step[1] == sizeof(T)) {                                                          \
            T part[LANES];                                                                                   \
            const T *a = (const T *)p;                                                                       \
            i64 lanes = n < LANES ? n : LANES, half;                                                         \
            memcpy(part, a, lanes * sizeof(T));                                                              \
            for (i = LANES; i + LANES <= n; i += LANES) IVDEP for (int k = 0; k < LANES; k++) part[k] = NAME##_of(part[k], a[i + k]); \
            IVDEP for (int k = 0; k < n - i; k++) part[k] = NAME##_of(part[k], a[i + k]);                    \
            for (; lanes > 1; lanes = half) {                                                                \
                half = (lanes + 1) / 2;                                                                      \
                IVDEP for (i64 k = 0; k < lanes - half; k++) part[k] = NAME##_of(part[k], part[k + half]);   \
            }                                                                                                \
            *(T *)o = NAME##_of(*(T *)o, part[0]);                                                           \
        } else if (step[0] == sizeof(T) && step[1] == sizeof(T)) IVDEP EACH(sizeof(T), NAME##_of(GET(T, o, sizeof(T)), GET(T, p, sizeof(T)))) \
        else EACH(step[0], NAME##_of(GET(T, o, step[0]), GET(T, p, step[1]))))

static inline cplx mul(cplx a, cplx b) {
    double x = creal(a), y = cimag(a), u = creal(b), v = cimag(b);
    return CMPLX(x * u - y * v, x * v + y * u);
}
static inline cplx quo(cplx a, cplx b) {
    const double u = creal(b), v = cimag(b);
    const int flat = fabs(u) >= fabs(v);
    const double p = flat ? u : v, q = flat ? v : u, x = flat ? creal(a) : cimag(a), y = flat ? cimag(a) : creal(a);
    const double r = p == 0.0 ? 0.0 : q / p, d = 1.0 / (p + q * r), e = flat ? d : -d;
    return CMPLX((x + y * r) * d, (y - x * r) * e);
}
static inline double larger(double a, double b) { return ((a >= b) | (a != a)) ? a : b; }
static inline double smaller(double a, double b) { return ((a <= b) | (a != a)) ? a : b; }

BINARIES(BINARY)
UNARIES(UNARY)
REDUCTIONS(REDUCE)

/* sine of a + quarters pi / 2 within 1 ulp, |a| < FAR: reduced by parts of pi / 2, then series of fdlibm */
#define FAR 1e5
static inline double wave(double a, int quarters) {
    const double n = rint(a * 0x1.45f306dc9c883p-1), once = a - n * 0x1.921fb54400000p+0, part = n * 0x1.0b4611a600000p-34;
    const double twice = once - part, tail = n * 0x1.3198a2e037073p-69 - ((once - twice) - part);
    const double y = twice - tail, e = (twice - y) - tail, z = y * y, v = z * y, half = 0.5 * z, w = 1.0 - half;
    const double s = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * (2.75573137070700676789e-06 +
                     z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)));
    const double c = z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 +
                     z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)))));
    const double sine = y - ((z * (0.5 * e - v * s) - e) + v * 1.66666666666666324348e-01);
    const double cosine = w + (((1.0 - w) - half) + (z * c - y * e));
    const int turn = (int)n + quarters;
    const double found = turn & 1 ? cosine : sine;
    return turn & 2 ? -found : found;
}
/* the exponential of a within 1 ulp, |a| < 700, in the same way */
static inline double grow(double a) {
    const double n = rint(a * 0x1.71547652b82fep+0), most = a - n * 0x1.62e42fee00000p-1, rest = n * 0x1.a39ef35793c76p-33;
    const double x = most - rest, z = x * x;
    const double c = x - z * (1.66666666666666019037e-01 + z * (-2.77777777770155933842e-03 + z * (6.61375632143793436117e-05 +
                              z * (-1.65339022054652515390e-06 + z * 4.13813679705723846039e-08))));
    const i64 power = (i64)((int)n + 1023) << 52;
    double scale;
    memcpy(&scale, &power, sizeof scale);
    return scale * (1.0 - ((rest - x * c / (2.0 - c)) - most));
}
/* a wave of numbers that are all near; as the C library has it if one is not */
#define WAVE(NAME, QUARTERS, OTHER)                                                                          \
    ROWS_OF(NAME, 2,                                                                                         \
        double *o = (double *)at[0]; const double *p = (const double *)at[1];                                \
        int far = step[0] != 8 || step[1] != 8;                                                              \
        if (!far) IVDEP for (i = 0; i < n; i++) far |= !(fabs(p[i]) < FAR);                                  \
        if (!far) IVDEP for (i = 0; i < n; i++) o[i] = wave(p[i], QUARTERS);                                 \
        else for (i = 0; i < n; i++) { const double a = AT(double, 1, i); AT(double, 0, i) = fabs(a) < FAR ? wave(a, QUARTERS) : OTHER(a); })
WAVE(sin_d, 0, sin)
WAVE(cos_d, 1, cos)
ROWS_OF(exp_D, 2,
    double *o = (double *)at[0]; const double *p = (const double *)at[1];
    int far = step[0] != 16 || step[1] != 16;
    for (i = 0; i < n && !far; i++) far = !(fabs(p[2 * i]) < 700.0 && fabs(p[2 * i + 1]) < FAR);
    if (far) for (i = 0; i < n; i++) AT(cplx, 0, i) = cexp(AT(cplx, 1, i));
    else IVDEP for (i = 0; i < n; i++) {
        const double size = grow(p[2 * i]), a = p[2 * i + 1];
        o[2 * i] = size * wave(a, 1); o[2 * i + 1] = size * wave(a, 0);
    })

ROWS_OF(where_d, 4, for (i = 0; i < n; i++) AT(double, 0, i) = AT(char, 1, i) ? AT(double, 2, i) : AT(double, 3, i);)
ROWS_OF(where_D, 4, for (i = 0; i < n; i++) AT(cplx, 0, i) = AT(char, 1, i) ? AT(cplx, 2, i) : AT(cplx, 3, i);)

/* out, a, places: out[i] = a[i + places[i]], places in bytes; and the other way round */
#define FROM(T) *(T *)(at[1] + i * step[1] + AT(i64, 2, i))
#define INTO(T) *(T *)(at[0] + i * step[0] + AT(i64, 2, i))
ROWS_OF(gather_d, 3,
    if (step[2] == 0 && step[0] == 8 && step[1] == 8) memcpy(at[0], at[1] + *(i64 *)at[2], n * 8);
    else for (i = 0; i < n; i++) AT(double, 0, i) = FROM(double);)
ROWS_OF(gather_D, 3, for (i = 0; i < n; i++) AT(cplx, 0, i) = FROM(cplx);)
ROWS_OF(scatter_d, 3, for (i = 0; i < n; i++) INTO(double) = AT(double, 1, i);)
ROWS_OF(scatter_D, 3, for (i = 0; i < n; i++) INTO(cplx) = AT(cplx, 1, i);)
ROWS_OF(sadd_d, 3, for (i = 0; i < n; i++) INTO(double) += AT(double, 1, i);)

#define LISTED(f, ...) f,
static const Inner TABLE[] = {BINARIES(LISTED) UNARIES(LISTED) CHOICES(LISTED) REDUCTIONS(LISTED) SCATTERS(LISTED)};
#define TOLD(f, k) {#f, k},
#define TOLD_2(f, to, from, ...) {#f, #to #from},
#define TOLD_3(f, to, from, ...) {#f, #to #from #from},
const Kind KINDS[] = {BINARIES(TOLD_3) UNARIES(TOLD_2) CHOICES(TOLD) REDUCTIONS(TOLD_2) SCATTERS(TOLD) OTHERS(TOLD)};

/* to[i, j] = from[i, j], rows of the one and columns of the other contiguous: in squares of vectors */
typedef double vec __attribute__((vector_size(32), aligned(8)));
typedef i64 order __attribute__((vector_size(32)));
#ifdef __clang__
#define MIXED(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#define MIXED(a, b, ...) __builtin_shuffle(a, b, (order){__VA_ARGS__})
#endif
WIDE static void turned(char *to, i64 row, const char *from, i64 column, i64 m, i64 n) {
    for (i64 i = 0; i < m; i += 4) for (i64 j = 0; j < n; j += 4) {
        const char *p = from + i * 8 + j * column;
        char *q = to + i * row + j * 8;
        if (i + 4 > m || j + 4 > n) {
            for (i64 k = 0; k < 4 && i + k < m; k++)
                for (i64 l = 0; l < 4 && j + l < n; l++) *(double *)(q + k * row + l * 8) = *(const double *)(p + k * 8 + l * column);
            continue;
        }
        const vec a = *(const vec *)p, b = *(const vec *)(p + column), c = *(const vec *)(p + 2 * column), d = *(const vec *)(p + 3 * column);
        const vec e = MIXED(a, b, 0, 4, 2, 6), f = MIXED(a, b, 1, 5, 3, 7), g = MIXED(c, d, 0, 4, 2, 6), h = MIXED(c, d, 1, 5, 3, 7);
        *(vec *)q = MIXED(e, g, 0, 1, 4, 5); *(vec *)(q + row) = MIXED(f, h, 0, 1, 4, 5);
        *(vec *)(q + 2 * row) = MIXED(e, g, 2, 3, 6, 7); *(vec *)(q + 3 * row) = MIXED(f, h, 2, 3, 6, 7);
    }
}

static inline void elementwise(const Op *o, Inner inner) {
    const int last = (int)o->ndim - 1, rows = last - 1;
    char *at[OPERANDS];
    i64 step[OPERANDS], row[OPERANDS], count[DIMS];
    UNROLL for (int k = 0; k < OPERANDS; k++) {
        at[k] = o->at[k]; step[k] = o->step[k][last]; row[k] = o->step[k][rows < 0 ? 0 : rows];
    }
    if (rows <= 0) { inner(at, step, row, o->shape[last], rows < 0 ? 1 : o->shape[0]); return; }
    memset(count, 0, sizeof count);
    for (int d = 0; d >= 0;) {
        char *here[OPERANDS];
        memcpy(here, at, sizeof here);
        inner(here, step, row, o->shape[last], o->shape[rows]);
        for (d = rows - 1; d >= 0 && ++count[d] == o->shape[d]; count[d--] = 0)
            for (int k = 0; k < OPERANDS; k++) at[k] -= o->step[k][d] * (o->shape[d] - 1);
        for (int k = 0; k < OPERANDS && d >= 0; k++) at[k] += o->step[k][d];
    }
}

/* ---------------------------------------------------------------- products of matrices */

/* Return memory for numbers that nobody needs afterwards, where lines of the cache begin; NULL if there is none. */
double *workspace(i64 numbers) {
    static char *memory;
    static i64 size;
    const i64 line = 64, need = numbers * 8 + line;
    if (need > size) {
        char *grown = realloc(memory, need);
        if (!grown) return NULL;
        memory = grown; size = need;
    }
    return (double *)(memory + (-(uintptr_t)memory & (line - 1)));
}

/* PRODUCT: c from rows of a and b, whose columns are contiguous and its rows pb bytes apart, in panels of at most
 * MOST vectors; the last vector of a row may overlap the one before it, and rows beyond the last one repeat it */
#define ROWS 4
#define PRODUCT(NAME, VEC, MOST, ISA)                                                                        \
    static inline __attribute__((always_inline)) void NAME##_panel(                                          \
        const Op *o, char *c, const char *a, const char *b, i64 pb, i64 j, const int V) {                    \
        const i64 m = o->shape[0], kk = o->shape[1], mode = o->more, left = o->shape[2] - j;                 \
        const i64 ci = o->step[0][0], cj = o->step[0][2], ai = o->step[1][0], ak = o->step[1][1];            \
        const i64 w = sizeof(VEC) / 8, wide = left < V * w ? left : V * w;                                   \
        for (i64 i = 0; i < m; i += ROWS) {                                                                  \
            const char *row[ROWS], *p = b + 8 * j;                                                           \
            VEC x[ROWS][MOST], y[MOST];                                                                      \
            UNROLL for (int r = 0; r < ROWS; r++) {                                                          \
                row[r] = a + (i + r < m ? i + r : m - 1) * ai;                                               \
                UNROLL for (int v = 0; v < V; v++) x[r][v] = (VEC){0};                                       \
            }                                                                                                \
            for (i64 k = 0; k < kk; k++, p += pb) {                                                          \
                UNROLL for (int v = 0; v < V; v++) y[v] = *(const VEC *)(p + 8 * (v < V - 1 ? v * w : wide - w)); \
                UNROLL for (int r = 0; r < ROWS; r++) {                                                      \
                    const double f = *(const double *)(row[r] + k * ak);                                     \
                    UNROLL for (int v = 0; v < V; v++) x[r][v] += f * y[v];                                  \
                }                                                                                            \
            }                                                                                                \
            UNROLL for (int r = 0; r < ROWS; r++) {                                                          \
                double out[MOST * sizeof(VEC) / 8], *to = (double *)(c + (i + r) * ci + j * cj);             \
                double *set = mode == 0 && cj == 8 ? to : out;                                               \
                if (i + r >= m) break;                                                                       \
                UNROLL for (int v = 0; v < V; v++) *(VEC *)(set + (v < V - 1 ? v * w : wide - w)) = x[r][v]; \
                if (set != to) placed(to, cj, out, wide, mode);                                              \
            }                                                                                                \
        }                                                                                                    \
    }                                                                                                        \
    ISA static void NAME(const Op *o, char *c, const char *a, const char *b, i64 pb) {                       \
        const int w = sizeof(VEC) / 8, all = (int)((o->shape[2] + w - 1) / w), panels = (all + MOST - 1) / MOST; \
        for (int q = 0, j = 0, v; q < panels; q++, j += v * w) switch (v = (all + q) / panels) {             \
            case 1: NAME##_panel(o, c, a, b, pb, j, 1); break;                                               \
            case 2: NAME##_panel(o, c, a, b, pb, j, 2); break;                                               \
            case 3: NAME##_panel(o, c, a, b, pb, j, 3); break;                                               \
            case 4: NAME##_panel(o, c, a, b, pb, j, MOST < 4 ? MOST : 4); break;                             \
            default: NAME##_panel(o, c, a, b, pb, j, MOST);                                                  \
        }                                                                                                    \
    }
typedef double wider __attribute__((vector_size(64), aligned(8)));

static inline __attribute__((always_inline)) void placed(double *to, i64 step, const double *out, i64 n, i64 mode) {
    const i64 s = step / 8;
    if (mode == 0) for (i64 j = 0; j < n; j++) to[j * s] = out[j];
    else for (i64 j = 0; j < n; j++) to[j * s] += mode * out[j];
}
PRODUCT(product, vec, 3, WIDE)
PRODUCT(wider_product, wider, 5, WIDER)

/* b with contiguous columns */
WIDE static const char *packed(const Op *o, const char *b, double *scratch) {
    const i64 kk = o->shape[1], n = o->shape[2], bk = o->step[2][1], bj = o->step[2][2];
    double *to = scratch;
    if (bk == 8) turned((char *)to, 8 * n, b, bj, kk, n);
    else for (i64 k = 0; k < kk; k++, b += bk, to += n) for (i64 j = 0; j < n; j++) to[j] = *(const double *)(b + j * bj);
    return (const char *)scratch;
}

/* a part of small ones, of which there are many */
static inline __attribute__((always_inline)) void corner(const Op *o, i64 row, i64 column, const int M, const int N) {
    const i64 kk = o->shape[1], mode = o->more, *cs = o->step[0], *as = o->step[1], *bs = o->step[2];
    for (i64 p = 0; p < o->shape[3]; p++) for (i64 q = 0; q < o->shape[4]; q++) {
        char *c = o->at[0] + p * cs[3] + q * cs[4] + row * cs[0] + column * cs[2];
        const char *a = o->at[1] + p * as[3] + q * as[4] + row * as[0], *b = o->at[2] + p * bs[3] + q * bs[4] + column * bs[2];
        double sum[4][4] = {{0}};
        for (i64 k = 0; k < kk; k++, a += as[1], b += bs[1])
            UNROLL for (int i = 0; i < M; i++) UNROLL for (int j = 0; j < N; j++)
                sum[i][j] += *(const double *)(a + i * as[0]) * *(const double *)(b + j * bs[2]);
        UNROLL for (int i = 0; i < M; i++) UNROLL for (int j = 0; j < N; j++) {
            double *out = (double *)(c + i * cs[0] + j * cs[2]);
            *out = mode == 0 ? sum[i][j] : mode == 1 ? *out + sum[i][j] : *out - sum[i][j];
        }
    }
}
#define CORNER(M, N) case 4 * M + N: corner(o, i, j, M, N); break;
#define CORNERS(M) CORNER(M, 1) CORNER(M, 2) CORNER(M, 3) CORNER(M, 4)
WIDE static void small(const Op *o) {
    for (i64 i = 0; i < o->shape[0]; i += 4) for (i64 j = 0; j < o->shape[2]; j += 4) {
        const i64 rows = o->shape[0] - i, columns = o->shape[2] - j;
        switch (4 * (rows < 4 ? rows : 4) + (columns < 4 ? columns : 4)) { CORNERS(1) CORNERS(2) CORNERS(3) CORNERS(4) }
    }
}

/* shape: m, k, n, batch, batch; steps: out (i, -, j), a (i, k, -), b (-, k, j); more: 0 set, 1 add, -1 subtract */
static int matmul(const Op *o) {
    const i64 m = o->shape[0], kk = o->shape[1], n = o->shape[2], packs = o->step[2][2] != 8;
    const int wide = n >= 8 && HAS_WIDER;
    double *scratch;
    if (n < 4 || (m * n < 16 && kk < 16) || (packs && m == 1)) { small(o); return 0; }
    scratch = packs ? workspace(kk * n) : NULL;
    if (packs && !scratch) return -1;
    for (i64 p = 0; p < o->shape[3]; p++)
        for (i64 q = 0; q < o->shape[4]; q++) {
            char *at[3];
            for (int k = 0; k < 3; k++) at[k] = o->at[k] + p * o->step[k][3] + q * o->step[k][4];
            (wide ? wider_product : product)(o, at[0], at[1], packs ? packed(o, at[2], scratch) : at[2], packs ? 8 * n : o->step[2][1]);
        }
    return 0;
}

/* o = v a + w b, or o += that */
static inline __attribute__((always_inline)) void combine(
    char *o, const char *a, const char *b, i64 to, i64 from, i64 n, double v, double w, i64 sets) {
#define COMBINED(OP, EXPR) IVDEP for (i64 i = 0; i < n; i++) *(double *)(o + i * to) OP EXPR
    if (sets && w == 0.0) COMBINED(=, v * GET(double, a, from));
    else if (sets) COMBINED(=, v * GET(double, a, from) + w * GET(double, b, from));
    else COMBINED(+=, v * GET(double, a, from) + w * GET(double, b, from));
}

/* out, b, pairs; shape: pairs, columns; steps: rows and columns */
WIDE static int sparse(const Op *o) {
    const i64 *to = o->step[0], *from = o->step[1];
    const Pair *pair = (const Pair *)o->at[2];
    for (i64 k = 0; k < o->shape[0]; k++, pair++) {
        char *c = o->at[0] + pair->out;
        const char *a = o->at[1] + pair->from[0], *b = o->at[1] + pair->from[1];
        const double v = pair->weight[0], w = pair->weight[1];
        const i64 n[2] = {pair->rows, o->shape[1]}, sets = pair->sets;
        if (n[0] == 1 && n[1] == 1) { /* most entries of single states */
            const double sum = v * *(const double *)a + (w == 0.0 ? 0.0 : w * *(const double *)b);
            *(double *)c = sets == 2 ? 0.0 : sets ? sum : *(double *)c + sum;
            continue;
        }
        const int in = n[0] < (to[0] == 8 && from[0] == 8 ? 4 : n[1]), out = !in; /* what is gone through inside */
        for (i64 i = 0; i < n[out]; i++, c += to[out], a += from[out], b += from[out]) {
            if (sets == 2) for (i64 j = 0; j < n[in]; j++) *(double *)(c + j * to[in]) = 0.0;
            else if (to[in] == 8 && from[in] == 8) combine(c, a, b, 8, 8, n[in], v, w, sets);
            else if (to[in] == 8) combine(c, a, b, 8, from[in], n[in], v, w, sets);
            else combine(c, a, b, to[in], from[in], n[in], v, w, sets);
        }
    }
    return 0;
}

/* out, a, b, products of rows; shape: products, columns */
WIDE static int products(const Op *o) {
    const RowProduct *one = (const RowProduct *)o->at[3];
    for (i64 k = 0, n = o->shape[1]; k < o->shape[0]; k++, one++) {
        double *to = (double *)(o->at[0] + one->out);
        const double *a = (const double *)(o->at[1] + one->from[0]), *b = (const double *)(o->at[2] + one->from[1]);
        if (one->sets) IVDEP for (i64 j = 0; j < n; j++) to[j] = a[j] * b[j];
        else IVDEP for (i64 j = 0; j < n; j++) to[j] += a[j] * b[j];
    }
    return 0;
}

/* ---------------------------------------------------------------- Python */

void tell_failure(const char *why) {
    PyObject *linalg = PyImport_ImportModule("numpy.linalg");
    PyObject *error = linalg ? PyObject_GetAttrString(linalg, "LinAlgError") : NULL;
    if (error) PyErr_SetString(error, why);
    Py_XDECREF(linalg);
    Py_XDECREF(error);
}

int operate(const Op *o) {
    static int (*const WHOLE[])(const Op *) = {matmul, sparse, products, resolve, resolve, resolve, resolve};
    int failed = 0;
    if (o->code == copy_d_code && o->ndim == 2 && o->step[0][1] == 8 && o->step[1][0] == 8)
        turned(o->at[0], o->step[0][0], o->at[1], o->step[1][1], o->shape[0], o->shape[1]);
    else if (o->code < matmul_code) elementwise(o, TABLE[o->code]);
    else failed = WHOLE[o->code - matmul_code](o);
    if (failed > 0) tell_failure(o->code == modes_code ? "Eigenvalues did not converge" : "Singular matrix");
    else if (failed) PyErr_NoMemory();
    return failed;
}

/* Do the operations in a buffer; on failure an exception is set. */
int replay(const Py_buffer *ops, PyObject *calls) {
    const Op *o = ops->buf, *end = o + ops->len / sizeof(Op);
    for (; o < end; o++) {
        if (o->code != call_code) { if (operate(o)) return -1; continue; }
        PyObject *one = PyList_GetItem(calls, o->more), *done = one ? PyObject_CallNoArgs(one) : NULL;
        if (!done) return -1;
        Py_DECREF(done);
    }
    return 0;
}

static PyObject *run(PyObject *self, PyObject *args) {
    Py_buffer ops;
    PyObject *calls;
    if (!PyArg_ParseTuple(args, "y*O!", &ops, &PyList_Type, &calls)) return NULL;
    int failed = replay(&ops, calls);
    PyBuffer_Release(&ops);
    if (failed) return NULL;
    Py_RETURN_NONE;
}

static PyMethodDef METHODS[] = {
    {"run", run, METH_VARARGS, "Do operations (n, WORDS) on their memory, and calls of Python from a list."},
    {"march", march, METH_VARARGS, "Make ordinary steps and try one more; return whether it was tried."},
    {"record", record, METH_O, "Have a tape, or none, write down what this thread does with arrays."},
    {NULL, NULL, 0, NULL},
};

static int fill(PyObject *module) {
    PyObject *codes = PyDict_New(), *tape = tape_type(module), *written = written_type(module);
    int failed = !codes || !tape || !written || PyModule_AddObjectRef(module, "CODES", codes) || PyModule_AddObjectRef(module, "Tape", tape) ||
                 PyModule_AddObjectRef(module, "Written", written) || PyModule_AddIntConstant(module, "SOURCE", SOURCE);
    for (int k = 0; k < CODES && !failed; k++) {
        PyObject *code = PyLong_FromLong(k);
        failed = !code || PyDict_SetItemString(codes, KINDS[k].name, code);
        Py_XDECREF(code);
    }
    Py_XDECREF(codes); Py_XDECREF(tape); Py_XDECREF(written);
    return failed ? -1 : 0;
}

static PyModuleDef_Slot SLOTS[] = {{Py_mod_exec, fill}, {0, NULL}};
static struct PyModuleDef MODULE = {PyModuleDef_HEAD_INIT, "_replay", "Replays tapes of array operations.", 0,
                                    METHODS, SLOTS, NULL, NULL, NULL};
PyMODINIT_FUNC PyInit__replay(void) { return PyModuleDef_Init(&MODULE); }
