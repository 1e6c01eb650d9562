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

/* twice, for processors with and without wide vectors, where the compiler and the C library can choose at start;
 * products of matrices a third time, for still wider ones */
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

/* elementwise operations: what they write and read, d real, D complex, b truth, i places in bytes; those from
 * radd_d on go through what they read and write where they are told */
#define ELEMENTWISE(X)                                                                                       \
    X(add_d, "ddd") X(sub_d, "ddd") X(mul_d, "ddd") X(div_d, "ddd") X(max_d, "ddd") X(min_d, "ddd")          \
    X(pow_d, "ddd") X(hyp_d, "ddd") X(at2_d, "ddd") X(add_D, "DDD") X(sub_D, "DDD") X(mul_D, "DDD")          \
    X(div_D, "DDD") X(lt_d, "bdd") X(le_d, "bdd") X(gt_d, "bdd") X(ge_d, "bdd") X(eq_d, "bdd")               \
    X(ne_d, "bdd") X(copy_d, "dd") X(copy_D, "DD") X(copy_b, "bb") X(cast_D, "Dd") X(neg_d, "dd")            \
    X(abs_d, "dd") X(sqr_d, "dd") X(sqrt_d, "dd") X(sin_d, "dd") X(cos_d, "dd") X(tan_d, "dd")               \
    X(exp_d, "dd") X(sinh_d, "dd") X(cosh_d, "dd") X(rint_d, "dd") X(sign_d, "dd") X(neg_D, "DD")            \
    X(sqr_D, "DD") X(conj_D, "DD") X(exp_D, "DD")                                                            \
    X(abs_D, "dD") X(where_d, "dbdd") X(where_D, "DbDD") X(gather_d, "ddi") X(gather_D, "DDi")               \
    X(radd_d, "dd") X(radd_D, "DD") X(rmax_d, "dd") X(rmin_d, "dd") X(scatter_d, "ddi") X(scatter_D, "DDi")  \
    X(sadd_d, "ddi")

/* the others, which mean what stands where they are done; D also real */
#define OTHERS(X)                                                                                            \
    X(matmul, "ddd") X(sparse, "dddi") X(products, "dddi") X(factor, "DD") X(solve, "DDD") X(basis, "dd")    \
    X(modes, "dd") X(call, "") X(uses, "")

#define NAMED(f, k) f##_code,
enum { ELEMENTWISE(NAMED) OTHERS(NAMED) CODES };
typedef struct { const char *name, *kinds; } Kind;
extern const Kind KINDS[];

int operate(const Op *o);
int resolve(const Op *o); /* operations from factor on */
double *workspace(i64 numbers);
PyObject *tape_type(PyObject *module);
PyObject *written_type(PyObject *module);
PyObject *record(PyObject *module, PyObject *tape);
#endif
