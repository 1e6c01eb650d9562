/* Operations on fixed memory: what writes them down (_record.c) and what repeats them (_replay.c).
 *
 * An operation has a code, a shape of at most DIMS dimensions and for each operand an address and strides in
 * bytes; what they mean stands at the codes.
 */
#ifndef REPLAY_H
#define REPLAY_H
#define Py_LIMITED_API 0x030b0000
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <stdint.h>

/* once for each kind of vectors, where the compiler and the C library can choose at start; products of matrices once
 * more, in pieces for the widest */
#if !defined(__SANITIZE_ADDRESS__) && defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
#if __GNUC__ >= 12
#define WIDE __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define WIDE __attribute__((target_clones("avx2", "default")))
#endif
#define WIDER __attribute__((target("avx512f")))
#define HAS_WIDER __builtin_cpu_supports("avx512f")
#else
#define WIDE
#define WIDER
#define HAS_WIDER 0
#endif

#define DIMS 5
#define OPERANDS 4
typedef int64_t i64;
typedef struct {
    i64 code, ndim, shape[DIMS];
    char *at[OPERANDS];
    i64 step[OPERANDS][DIMS];
    i64 more;
} Op;
_Static_assert(sizeof(Op) == 256 && sizeof(void *) == 8, "a machine with addresses of 8 bytes");

/* Elementwise operations: what they write and read (d real, D complex, b truth, i places in bytes), and what that is. */
#define BINARIES(X)                                                                                          \
    X(add_d, d, d, a + b) X(sub_d, d, d, a - b) X(mul_d, d, d, a * b) X(div_d, d, d, a / b)                  \
    X(max_d, d, d, larger(a, b)) X(min_d, d, d, smaller(a, b)) X(pow_d, d, d, pow(a, b))                     \
    X(at2_d, d, d, atan2(a, b)) X(add_D, D, D, a + b) X(sub_D, D, D, a - b) X(mul_D, D, D, mul(a, b))        \
    X(div_D, D, D, quo(a, b)) X(lt_d, b, d, a < b) X(le_d, b, d, a <= b) X(gt_d, b, d, a > b)                \
    X(ge_d, b, d, a >= b) X(eq_d, b, d, a == b) X(ne_d, b, d, a != b)
#define UNARIES(X)                                                                                           \
    X(copy_d, d, d, a) X(copy_D, D, D, a) X(copy_b, b, b, a) X(cast_D, D, d, a) X(neg_d, d, d, -a)           \
    X(abs_d, d, d, fabs(a)) X(sqr_d, d, d, a * a) X(sqrt_d, d, d, sqrt(a)) X(tan_d, d, d, tan(a))            \
    X(exp_d, d, d, exp(a)) X(sinh_d, d, d, sinh(a)) X(cosh_d, d, d, cosh(a)) X(tanh_d, d, d, tanh(a))        \
    X(log_d, d, d, log(a)) X(asin_d, d, d, asin(a)) X(acos_d, d, d, acos(a)) X(atan_d, d, d, atan(a))        \
    X(rint_d, d, d, rint(a))                                                                                 \
    X(sign_d, d, d, a > 0 ? 1.0 : a < 0 ? -1.0 : a == 0 ? 0.0 : a) X(abs_D, d, D, cabs(a))                   \
    X(neg_D, D, D, -a) X(sqr_D, D, D, mul(a, a)) X(conj_D, D, D, CMPLX(creal(a), -cimag(a)))
#define CHOICES(X)                                                                                           \
    X(sin_d, "dd") X(cos_d, "dd") X(exp_D, "DD") X(where_d, "dbdd") X(where_D, "DbDD") X(gather_d, "ddi") X(gather_D, "DDi")
/* those from here on go through what they read and write where they are told */
#define REDUCTIONS(X) X(radd_d, d, d, r + a) X(radd_D, D, D, r + a) X(rmax_d, d, d, larger(r, a)) X(rmin_d, d, d, smaller(r, a))
#define SCATTERS(X) X(scatter_d, "ddi") X(scatter_D, "DDi") X(sadd_d, "ddi")
/* The others, which mean what stands where they are done; D also real. */
#define OTHERS(X)                                                                                            \
    X(matmul, "ddd") X(sparse, "ddi") X(products, "dddi") X(factor, "DD") X(solve, "DDD") X(basis, "dd")    \
    X(modes, "dd") X(call, "") X(uses, "")
#define NAMED(f, ...) f##_code,
enum { BINARIES(NAMED) UNARIES(NAMED) CHOICES(NAMED) REDUCTIONS(NAMED) SCATTERS(NAMED) OTHERS(NAMED) CODES };
typedef struct { const char *name, *kinds; } Kind;
extern const Kind KINDS[];

/* two entries of a row of a sparse matrix, and rows after it that go on as it does: what they add to out or set it to (2:
 * to zero); and a product of two rows likewise; places in bytes */
typedef struct { double weight[2]; i64 from[2], out, sets, rows; } Pair;
typedef struct { i64 from[2], out, sets; } RowProduct;

int operate(const Op *o);
int resolve(const Op *o); /* operations from factor on */
double *workspace(i64 numbers);
void tell_failure(const char *why); /* as LinAlgError */
int replay(const Py_buffer *ops, PyObject *calls);
PyObject *march(PyObject *module, PyObject *args);
PyObject *tape_type(PyObject *module);
PyObject *written_type(PyObject *module);
PyObject *record(PyObject *module, PyObject *tape);
#endif
