/* Writes down operations (hfsim/maths/tape.py): a tape holds memory, and what is to be done on it.
 *
 * Memory comes from large blocks, so that an address tells whose it is.  What is no longer referred to is used anew
 * within the same program: it is written again there before it is read.
 */
#include "_replay.h"
#include <stdlib.h>
#include <string.h>

#define MOST 8          /* dimensions of an array at most */
#define BLOCKS 32       /* each twice as large as the one before */
#define FIRST_BLOCK (1 << 18)
#define FIRST_ROOM 4096 /* of lists: as many operations as most recordings have, so that few are copied */
#define LARGEST ((i64)1 << 48) /* bytes of an array */
#define GRAIN 64        /* bytes that belong to one piece of memory */
#define NARROW 4        /* columns below which a product of matrices is done as that of their transposes */
#define SHORT 16        /* entries in a row below which the longest dimension is gone through instead */
#define SPARSE_PART 0.1 /* of a constant matrix that is not zero, up to which a product is done entry by entry */
enum { FIXED = 1, INPUT = 2, ALIVE = 4, USED = 8 };

typedef struct { char *at; i64 item; int nd; i64 shape[MOST], step[MOST]; } View;
typedef struct { char *at; i64 size; int item, flags, read, program; } Piece;
typedef struct { char *base, *low, *high; int32_t *piece; } Block;
typedef struct { int32_t of[OPERANDS]; } Pieces;
typedef struct {
    PyObject_HEAD
    PyObject *type, *refused, *copy, *constants, *dtypes, *codes;
    Block blocks[BLOCKS]; int n_blocks, program, ended;
    char *next;
    Op *ops; Pieces *touched; i64 count, room, room_touched;
    Piece *pieces; i64 n_pieces, room_pieces;
    int32_t *left; i64 n_left, room_left; /* pieces to be used anew */
} Tape;

/* NumPy's arrays, as its binary interface has them: how they begin, and what it offers */
typedef struct { PyObject_HEAD char *at; int nd; i64 *shape, *step; PyObject *base, *dtype; int flags; } Array;
typedef PyObject *NewArray(PyTypeObject *, PyObject *dtype, int nd, const i64 *shape, const i64 *step, char *at, int, PyObject *);
enum { VERSION = 0, TYPE = 2, NEW = 94, SET_BASE = 282, WRITEABLE = 0x500 };
static void **numpy;
static PyTypeObject *array;

static int refuse(Tape *t, const char *why) { PyErr_SetString(t->refused, why); return -1; }
static void *refused(Tape *t, const char *why) { PyErr_SetString(t->refused, why); return NULL; }
static void *misused(const char *why) { PyErr_SetString(PyExc_TypeError, why); return NULL; }

static int grown(void **list, i64 count, i64 *room, size_t size) {
    if (count < *room) return 0;
    i64 more = *room ? 2 * *room : FIRST_ROOM;
    void *found = realloc(*list, more * size);
    if (!found) { PyErr_NoMemory(); return -1; }
    *list = found; *room = more;
    return 0;
}

/* ---------------------------------------------------------------- memory */

static int32_t piece_at(const Tape *t, const char *at) {
    for (int k = t->n_blocks - 1; k >= 0; k--) {
        const Block *b = &t->blocks[k];
        if (at >= b->low && at < b->high) return b->piece[(at - b->low) / GRAIN];
    }
    return -1;
}

static int known(const Tape *t, const char *at) { return piece_at(t, at) >= 0; }

/* Return the piece in which an array lies; NULL if it lies elsewhere or is none. */
static Piece *piece_of(const Tape *t, PyObject *a) {
    const int32_t piece = PyObject_TypeCheck(a, array) ? piece_at(t, ((const Array *)a)->at) : -1;
    return piece < 0 ? NULL : &t->pieces[piece];
}

static int writeable(PyObject *a) { return ((const Array *)a)->flags & 0x400; }

static i64 entries(const View *v) {
    i64 n = 1;
    for (int d = 0; d < v->nd; d++) n *= v->shape[d];
    return n;
}

static int add_block(Tape *t, i64 size) {
    i64 bytes = (i64)FIRST_BLOCK << t->n_blocks;
    if (bytes < size) bytes = size;
    if (t->n_blocks == BLOCKS) return refuse(t, "too much memory");
    Block *b = &t->blocks[t->n_blocks];
    b->base = malloc(bytes + GRAIN);
    b->piece = b->base ? malloc(bytes / GRAIN * sizeof(int32_t)) : NULL;
    if (!b->piece) { free(b->base); PyErr_NoMemory(); return -1; }
    b->low = b->base + (-(uintptr_t)b->base & (GRAIN - 1));
    b->high = b->low + bytes;
    memset(b->piece, 0xff, bytes / GRAIN * sizeof(int32_t));
    t->n_blocks++;
    t->next = b->low;
    return 0;
}

/* Give memory to an array of which item, nd and shape are told. */
static int place(Tape *t, View *v, int flags) {
    i64 bytes = v->item, grain = GRAIN, k;
    for (int d = v->nd - 1; d >= 0; d--) {
        v->step[d] = bytes;
        if (v->shape[d] < 0 || __builtin_mul_overflow(bytes, v->shape[d], &bytes) || bytes > LARGEST) return refuse(t, "too much memory");
    }
    while (16 * grain < bytes) grain *= 2;
    i64 size = bytes < GRAIN ? GRAIN : (bytes + grain - 1) / grain * grain;
    if (grown((void **)&t->pieces, t->n_pieces, &t->room_pieces, sizeof(Piece))) return -1;
    for (k = flags & FIXED ? -1 : t->n_left - 1; k >= 0 && t->pieces[t->left[k]].size != size; k--) ;
    if (k >= 0) {
        v->at = t->pieces[t->left[k]].at;
        t->left[k] = t->left[--t->n_left];
    } else {
        if ((!t->n_blocks || t->next + size > t->blocks[t->n_blocks - 1].high) && add_block(t, size)) return -1;
        v->at = t->next;
        t->next += size;
    }
    if ((flags & (FIXED | INPUT)) != FIXED) memset(v->at, 0xff, size); /* no numbers */
    Block *b = t->blocks;
    while (v->at < b->low || v->at >= b->high) b++;
    for (k = 0; k < size / GRAIN; k++) b->piece[(v->at - b->low) / GRAIN + k] = (int32_t)t->n_pieces;
    t->pieces[t->n_pieces++] = (Piece){v->at, size, (int)v->item, flags, 0, t->program};
    return 0;
}

/* Let memory be used anew, but not by other programs: what one leaves to others must outlast that it is repeated. */
static void leave(Tape *t, int32_t piece) {
    const Piece *p = &t->pieces[piece];
    if (p->program != t->program || p->flags & FIXED) return;
    if (!grown((void **)&t->left, t->n_left, &t->room_left, sizeof(int32_t))) t->left[t->n_left++] = piece;
    else PyErr_Clear();
}

/* Note that no array refers to a piece any more. */
static void left(PyObject *memory) {
    PyObject *tape = PyCapsule_GetPointer(memory, NULL);
    leave((Tape *)tape, (int32_t)(intptr_t)PyCapsule_GetContext(memory));
    Py_DECREF(tape);
}

/* Return an array with such memory. */
static PyObject *array_of(Tape *t, const View *v) {
    PyObject *dtype = PyTuple_GetItem(t->dtypes, v->item == 8 ? 0 : v->item == 16 ? 1 : 2);
    PyObject *memory = PyCapsule_New(t, NULL, left);
    if (!memory) return NULL;
    Py_INCREF((PyObject *)t);
    PyCapsule_SetContext(memory, (void *)(intptr_t)piece_at(t, v->at));
    PyObject *found = ((NewArray *)numpy[NEW])((PyTypeObject *)t->type, Py_NewRef(dtype), v->nd, v->shape, NULL, v->at, WRITEABLE, NULL);
    if (!found) Py_DECREF(memory);
    else if (((int (*)(PyObject *, PyObject *))numpy[SET_BASE])(found, memory)) Py_CLEAR(found);
    return found;
}

static int viewed(Tape *t, PyObject *a, View *v) {
    if (!PyObject_TypeCheck(a, array)) { PyErr_SetString(PyExc_TypeError, "no array"); return -1; }
    const Array *own = (const Array *)a;
    if (own->nd > MOST) return refuse(t, "too many dimensions");
    *v = (View){own->at, 0, own->nd, {0}, {0}};
    for (int k = 0; k < 3; k++) if (own->dtype == PyTuple_GetItem(t->dtypes, k)) v->item = k == 0 ? 8 : k == 1 ? 16 : 1;
    for (int d = 0; d < own->nd; d++) { v->shape[d] = own->shape[d]; v->step[d] = own->step[d]; }
    return 0;
}

static int same_shape(const View *a, const View *b) {
    return a->nd == b->nd && !memcmp(a->shape, b->shape, a->nd * sizeof(i64));
}

/* Tell whether arrays hold the same numbers in the same places. */
static int alike(Tape *t, PyObject *a, PyObject *b) {
    View v, w;
    return PyObject_TypeCheck(a, array) && !viewed(t, a, &v) && !viewed(t, b, &w) && v.item && v.item == w.item && same_shape(&v, &w) &&
           !memcmp(v.step, w.step, v.nd * sizeof(i64)) && !memcmp(v.at, w.at, v.item * entries(&v));
}

/* Return a copy of an array that is no memory of the tape: one for all its uses, until it is changed. */
static PyObject *constant(Tape *t, PyObject *a) {
    PyObject *key = PyLong_FromVoidPtr(a), *kept = key ? PyDict_GetItemWithError(t->constants, key) : NULL, *value = NULL;
    if (key && !PyErr_Occurred() && !(kept && alike(t, a, PyTuple_GetItem(kept, 1))))
        if ((value = PyObject_CallFunctionObjArgs(t->copy, a, NULL)) && !(kept && alike(t, value, PyTuple_GetItem(kept, 1)))) {
            /* itself too, so that nothing else gets its address; and what it was */
            PyObject *all = Py_BuildValue("(OOO)", a, value, kept ? kept : Py_None);
            kept = all && !PyDict_SetItem(t->constants, key, all) ? all : NULL;
            Py_XDECREF(all);
        }
    Py_XDECREF(value);
    Py_XDECREF(key);
    return kept && !PyErr_Occurred() ? PyTuple_GetItem(kept, 1) : NULL;
}

/* See an operand: memory of the tape, or a constant, which may be a number. */
static int operand(Tape *t, PyObject *a, View *v) {
    if (PyFloat_Check(a) || PyLong_Check(a) || PyComplex_Check(a)) {
        *v = (View){NULL, PyComplex_Check(a) ? 16 : 8, 0, {0}, {0}};
        if (place(t, v, FIXED)) return -1;
        if (v->item == 16) ((double *)v->at)[1] = PyComplex_ImagAsDouble(a);
        *(double *)v->at = v->item == 16 ? PyComplex_RealAsDouble(a) : PyFloat_AsDouble(a);
        return PyErr_Occurred() ? -1 : 0;
    }
    int ours = PyObject_TypeCheck(a, (PyTypeObject *)t->type);
    if (PyObject_TypeCheck(a, array)) {
        if (viewed(t, a, v)) return -1;
        if (known(t, v->at)) return v->item ? 0 : refuse(t, "numbers of another type");
        if (ours) return entries(v) ? refuse(t, "memory of unknown origin") : 0;
    }
    PyObject *found = constant(t, a);
    return found ? viewed(t, found, v) : -1;
}

/* ---------------------------------------------------------------- elementwise operations */

static i64 step_of(const View *v, int nd, int d) {
    int own = d - (nd - v->nd);
    return own < 0 || v->shape[own] == 1 ? 0 : v->step[own];
}

/* Widen the shape of s by broadcasting v. */
static int broadcast(Tape *t, View *s, const View *v) {
    int nd = s->nd > v->nd ? s->nd : v->nd;
    View w = {NULL, 8, nd, {0}, {0}};
    for (int d = 0; d < nd; d++) {
        int a = d - (nd - s->nd), b = d - (nd - v->nd);
        i64 m = a < 0 ? 1 : s->shape[a], n = b < 0 ? 1 : v->shape[b];
        if (m != n && m != 1 && n != 1) return refuse(t, "shapes differ");
        w.shape[d] = m == 1 ? n : m;
    }
    *s = w;
    return 0;
}

static void swap(i64 *a, i64 *b) { i64 c = *a; *a = *b; *b = c; }

static int append(Tape *t, const Op *o) {
    if (t->ended) return refuse(t, "a tape that has ended");
    if (grown((void **)&t->ops, t->count, &t->room, sizeof(Op))) return -1;
    if (grown((void **)&t->touched, t->count, &t->room_touched, sizeof(Pieces))) return -1;
    for (int k = 0; k < OPERANDS; k++) {
        const i64 piece = t->touched[t->count].of[k] = o->at[k] ? piece_at(t, o->at[k]) : -1;
        if (piece >= 0 && (k || o->code == uses_code)) t->pieces[piece].flags |= USED;
    }
    t->ops[t->count++] = *o;
    /* nothing is computed yet but what never changes: what takes numbers out of memory meanwhile finds none */
    const i64 piece = t->touched[t->count - 1].of[0];
    return o->code < call_code && piece >= 0 && (t->pieces[piece].flags & (FIXED | INPUT)) == FIXED ? operate(o) : 0;
}

/* Write down an operation on n operands, the first of which is written, broadcast to the shape of s. */
static int elementwise(Tape *t, int code, const View *v, int n, const View *s) {
    Op o = {code, 0, {0}, {0}, {{0}}, 0};
    int order = code >= radd_d_code, last = -1, d, e, k;
    i64 steps[OPERANDS];
    for (k = 0; k < n; k++) o.at[k] = v[k].at;
    i64 dims[MOST][OPERANDS + 1];
    int count = 0;
    for (d = 0; d < s->nd; d++) { /* longest steps first */
        if (s->shape[d] == 0) return 0;
        if (s->shape[d] == 1) continue;
        for (k = 0; k < n; k++) steps[k] = step_of(&v[k], s->nd, d);
        for (e = count++; e > 0 && llabs(dims[e - 1][order]) < llabs(steps[order]); e--)
            memcpy(dims[e], dims[e - 1], sizeof dims[e]);
        memcpy(dims[e], steps, sizeof steps);
        dims[e][OPERANDS] = s->shape[d];
    }
    for (d = 0; d < count; d++) { /* merged where one goes on as the other */
        int goes_on = last >= 0;
        for (k = 0; k < n && goes_on; k++) goes_on = o.step[k][last] == dims[d][OPERANDS] * dims[d][k];
        if (!goes_on && ++last == DIMS) return refuse(t, "too many dimensions");
        o.shape[last] = (goes_on ? o.shape[last] : 1) * dims[d][OPERANDS];
        for (k = 0; k < n; k++) o.step[k][last] = dims[d][k];
    }
    for (d = e = 0; d < last; d++) if (o.shape[d] > o.shape[e]) e = d;
    if (last > 0 && o.shape[last] < SHORT && o.shape[last] < o.shape[e]) { /* the longest inside, for fewer calls */
        swap(&o.shape[last], &o.shape[e]);
        for (k = 0; k < n; k++) swap(&o.step[k][last], &o.step[k][e]);
    }
    if (last < 0) { last = 0; o.shape[0] = 1; for (k = 0; k < n; k++) o.step[k][0] = 8; }
    o.ndim = last + 1;
    return append(t, &o);
}

/* Copy an operand into memory of its own: a constant once and for all. */
static int copied(Tape *t, View *v, int code, i64 item) {
    View w[2] = {*v, *v};
    i64 count = t->count, piece = piece_at(t, v->at), constant = piece < 0 || (t->pieces[piece].flags & (FIXED | INPUT)) == FIXED;
    w[0].item = item;
    if (place(t, &w[0], constant ? FIXED : 0) || elementwise(t, code, w, 2, &w[0])) return -1;
    if (constant) t->count = count;
    *v = w[0];
    return 0;
}

static i64 item_of(char kind) { return kind == 'D' ? 16 : kind == 'b' ? 1 : 8; }
static int copy_code(i64 item) { return item == 8 ? copy_d_code : item == 16 ? copy_D_code : copy_b_code; }

static char *lowest(const View *v, i64 *extent) {
    char *low = v->at;
    *extent = v->item;
    for (int d = 0; d < v->nd; d++) {
        i64 reach = v->step[d] * (v->shape[d] - 1);
        *extent += llabs(reach);
        if (reach < 0) low += reach;
    }
    return low;
}

/* Extent of what lies between two multiples of a step. */
static i64 within(const View *v, i64 step) {
    i64 extent = v->item;
    for (int d = 0; d < v->nd; d++) if (v->step[d] % step) extent += llabs(v->step[d]) * (v->shape[d] - 1);
    return extent;
}

/* Whether two arrays may have an entry in common. */
static int overlap(const View *a, const View *b) {
    i64 m, n;
    char *p = lowest(a, &m), *q = lowest(b, &n);
    if (p + m <= q || q + n <= p) return 0;
    for (int d = 0; d < a->nd; d++) { /* columns or parts that lie between one another */
        i64 step = llabs(a->step[d]);
        if (!step || a->shape[d] < 2) continue;
        i64 ahead = ((q - p) % step + step) % step;
        if (ahead >= within(a, step) && step - ahead >= within(b, step)) return 0;
    }
    return 1;
}

static int same(const View *a, const View *b) {
    if (a->at != b->at || a->item != b->item || b->nd > a->nd) return 0;
    for (int d = 0; d < a->nd; d++) if (a->shape[d] > 1 && a->step[d] != step_of(b, a->nd, d)) return 0;
    return 1;
}

/* Whether what follows on each place along a dimension is as far away. */
static int spaced(const View *places, const char *at, int along, i64 step, int d) {
    if (d == places->nd) return *(const i64 *)(at + places->step[along]) - *(const i64 *)at == step;
    for (i64 k = 0; k < places->shape[d] - (d == along); k++)
        if (!spaced(places, at + k * places->step[d], along, step, d + 1)) return 0;
    return 1;
}

/* Let v go along with places in it: steps where they are equally spaced, which then are those of the first ones. */
static void follow(View *v, View *places) {
    View w = {v->at, v->item, places->nd, {0}, {0}};
    memcpy(w.shape, places->shape, sizeof w.shape);
    *v = w;
    if (!entries(v)) return;
    for (int d = v->nd - 1; d >= 0; d--) {
        if (v->shape[d] < 2) continue;
        i64 step = *(i64 *)(places->at + places->step[d]) - *(i64 *)places->at;
        if (!spaced(places, places->at, d, step, 0)) continue;
        v->step[d] = step;
        places->step[d] = 0;
    }
}

/* Whether columns, not rows, are contiguous. */
static int turned(const View *v) { return v->nd == 2 && v->item == 8 && v->step[0] == 8 && v->shape[0] >= NARROW && v->shape[1] >= NARROW; }

/* Write down an operation, by its code for real numbers or that for complex ones: out or None, ... -> out */
static PyObject *applied(Tape *t, int code, int complex_code, PyObject *const *args, int n) {
    View v[OPERANDS], s = {NULL, 8, 0, {0}, {0}};
    int k, given = args[0] != Py_None, complex = 0, copies[OPERANDS] = {0};
    int placed = code >= 0 && strchr(KINDS[code].kinds, 'i') != NULL;
    for (k = !given; k < n; k++) {
        if (placed && k == n - 1 ? viewed(t, args[k], &v[k]) : operand(t, args[k], &v[k])) return NULL;
        complex = complex || v[k].item == 16;
    }
    if (placed) { v[n - 1].item = 8; follow(&v[!given], &v[n - 1]); }
    if (complex) code = complex_code;
    if (code < 0) return Py_NewRef(Py_NotImplemented);
    if (code == copy_D_code && v[1].item == 8) code = cast_D_code;
    if (code == copy_d_code && v[1].item == 1) code = copy_b_code;
    const char *kinds = KINDS[code].kinds;
    if (!given) v[0].item = item_of(kinds[0]);
    else if (v[0].item != item_of(kinds[0])) return refused(t, "numbers of another type");
    else if (!writeable(args[0])) return refused(t, "a result that is only read");
    else if (!known(t, v[0].at) && entries(&v[0])) return refused(t, "a result outside of the memory");
    const int filled = given && code < radd_d_code;
    if (filled && n == 2 && code == copy_code(v[0].item) && same(&v[0], &v[1])) return Py_NewRef(args[0]);
    for (k = 1; k < n; k++) {
        const i64 item = item_of(kinds[k]);
        if (v[k].item == 8 && item == 16) copies[k] = cast_D_code;
        else if (v[k].item != item) return refused(t, "numbers of another type");
        else if (filled && !same(&v[0], &v[k]) && overlap(&v[0], &v[k])) copies[k] = copy_code(item);
        else if (n > 2 && !placed && turned(&v[k]) && !(given && turned(&v[0]))) copies[k] = copy_d_code; /* rows as they are gone through */
        if ((copies[k] && copied(t, &v[k], copies[k], item)) || broadcast(t, &s, &v[k])) return NULL;
    }
    if (filled) {
        View w = v[0];
        if (broadcast(t, &w, &s)) return NULL;
        if (!same_shape(&w, &v[0])) return refused(t, "a result of another shape");
        s = w;
    } else if (!given) {
        memcpy(v[0].shape, s.shape, sizeof s.shape);
        v[0].nd = s.nd;
        if (place(t, &v[0], 0)) return NULL;
    }
    PyObject *out = given ? Py_NewRef(args[0]) : array_of(t, &v[0]);
    if (out && elementwise(t, code, v, n, &s)) Py_CLEAR(out);
    for (k = 1; k < n; k++) if (copies[k]) leave(t, piece_at(t, v[k].at));
    return out;
}

/* apply(code for real numbers, code for complex ones, out or None, ...) -> out */
static PyObject *apply(Tape *t, PyObject *const *args, Py_ssize_t count) {
    if (count < 4 || count > OPERANDS + 2) return misused("apply");
    int codes[2] = {(int)PyLong_AsLong(args[0]), (int)PyLong_AsLong(args[1])};
    return PyErr_Occurred() ? NULL : applied(t, codes[0], codes[1], args + 2, (int)count - 2);
}

/* Set memory to what an operand is, broadcast to its shape. */
static int set(Tape *t, const View *o, const View *v) {
    if (v->item != o->item && (v->item != 8 || o->item != 16)) return refuse(t, "numbers of another type");
    View both[2] = {*o, *v};
    return elementwise(t, v->item == o->item ? copy_code(o->item) : cast_D_code, both, 2, o);
}

/* reduce(code for real numbers, code for complex ones, a, axes as bits, whether they stay, begin or None) -> result */
static PyObject *reduced(Tape *t, PyObject *const *args, Py_ssize_t count) {
    View v[2], begin, o;
    if (count != 6) return misused("reduce");
    long code[2] = {PyLong_AsLong(args[0]), PyLong_AsLong(args[1])}, axes = PyLong_AsLong(args[3]), stay = PyLong_AsLong(args[4]);
    if (PyErr_Occurred() || operand(t, args[2], &v[1])) return NULL;
    int first = args[5] == Py_None, kind = v[1].item == 16;
    if (v[1].item < 8 || code[kind] < 0 || (first && !entries(&v[1]))) return refused(t, "a reduction");
    v[0] = v[1];
    for (int d = 0; d < v[1].nd; d++) if (axes >> d & 1) v[0].shape[d] = 1;
    begin = v[0];
    if ((!first && operand(t, args[5], &begin)) || place(t, &v[0], 0)) return NULL;
    if (!first && begin.nd) return refused(t, "where a reduction begins");
    o = v[0];
    for (int d = o.nd = 0; d < v[0].nd; d++) if (stay || !(axes >> d & 1)) o.shape[o.nd++] = v[0].shape[d];
    PyObject *out = array_of(t, &o);
    if (out && (set(t, &v[0], &begin) || elementwise(t, (int)code[kind], v, 2, &v[1]))) Py_CLEAR(out);
    return out;
}

/* join(axis, arrays) -> one after another along an axis */
static PyObject *joined(Tape *t, PyObject *const *args, Py_ssize_t count) {
    View o = {0}, v;
    if (count != 2 || !PyList_Check(args[1])) return misused("join");
    const long axis = PyLong_AsLong(args[0]);
    const Py_ssize_t n = PyList_Size(args[1]);
    for (Py_ssize_t k = 0; k < n; k++) {
        if (operand(t, PyList_GetItem(args[1], k), &v)) return NULL;
        i64 before = k ? o.shape[axis] : 0, item = o.item;
        if (axis < 0 || axis >= v.nd) return refused(t, "no such axis");
        o.shape[axis] = v.shape[axis];
        if (k && !same_shape(&o, &v)) return refused(t, "shapes differ");
        o = v;
        o.shape[axis] += before;
        if (o.item < item) o.item = item;
    }
    if (place(t, &o, 0)) return NULL;
    PyObject *out = array_of(t, &o);
    for (Py_ssize_t k = 0; k < n && out; k++) {
        if (operand(t, PyList_GetItem(args[1], k), &v)) Py_CLEAR(out);
        o.shape[axis] = v.shape[axis];
        if (out && set(t, &o, &v)) Py_CLEAR(out);
        o.at += v.shape[axis] * o.step[axis];
    }
    return out;
}

/* ---------------------------------------------------------------- products of matrices */

static void transpose(View *v) {
    swap(&v->shape[v->nd - 1], &v->shape[v->nd - 2]);
    swap(&v->step[v->nd - 1], &v->step[v->nd - 2]);
}

/* Write down a product of real matrices, batch by batch: 0 sets out, 1 adds, -1 subtracts. */
static int product(Tape *t, View o, View a, View b, i64 mode) {
    const int nd = o.nd, row = nd - 2, column = nd - 1;
    const View *all[] = {&o, &a, &b};
    i64 batch[MOST][4] = {{0}}; /* steps of each, and a length */
    int d, k, batches = 0;
    if (o.shape[column] < NARROW && o.shape[row] >= NARROW) {
        View c = a; a = b; b = c;
        transpose(&o); transpose(&a); transpose(&b);
    }
    i64 m = o.shape[row], n = o.shape[column];
    if (!entries(&o)) return 0;
    for (d = 0; d < row; d++) {
        if (o.shape[d] == 1) continue;
        for (k = 0; k < 3; k++) batch[batches][k] = all[k]->step[d];
        batch[batches++][3] = o.shape[d];
    }
    for (; batches; batches--) { /* rows or columns that go on as those of the matrix before them */
        const i64 *one = batch[batches - 1];
        if (one[2] == 0 && one[0] == m * o.step[row] && one[1] == m * a.step[row]) m *= one[3];
        else if (one[1] == 0 && one[0] == n * o.step[column] && one[2] == n * b.step[column]) n *= one[3];
        else break;
    }
    if (batches > 3) return refuse(t, "a product of so many dimensions");
    Op op = {matmul_code, 5, {m, a.shape[column], n, 1, 1}, {o.at, a.at, b.at},
             {{o.step[row], 0, o.step[column]}, {a.step[row], a.step[column], 0}, {0, b.step[row], b.step[column]}}, mode};
    const int repeated = batches > 2;
    for (d = repeated; d < batches; d++) {
        op.shape[3 + d - repeated] = batch[d][3];
        for (k = 0; k < 3; k++) op.step[k][3 + d - repeated] = batch[d][k];
    }
    for (i64 x = repeated ? batch[0][3] : 1; x > 0; x--) {
        if (append(t, &op)) return -1;
        for (k = 0; k < 3; k++) op.at[k] += batch[0][k];
    }
    return 0;
}

static View part(View v, int imaginary) {
    if (v.item == 16) v.at += 8 * imaginary;
    v.item = 8;
    return v;
}

static void insert(View *v, int at) { /* a dimension of one */
    memmove(v->shape + at + 1, v->shape + at, (v->nd - at) * sizeof(i64));
    memmove(v->step + at + 1, v->step + at, (v->nd - at) * sizeof(i64));
    v->shape[at] = 1; v->step[at] = 0; v->nd++;
}

static void widen(View *v, const View *o) { /* as many batches */
    while (v->nd < o->nd) insert(v, 0);
    for (int d = 0; d < o->nd - 2; d++) if (v->shape[d] == 1) v->step[d] = 0;
}

static int goes_on(const View *v) { return v->shape[0] == 1 || v->step[0] == v->shape[1] * v->step[1]; }
static void drop(View *v) { /* the first dimension, whose rows are added to those of the second one */
    v->nd--;
    v->shape[1] *= v->shape[0];
    memmove(v->shape, v->shape + 1, v->nd * sizeof(i64));
    memmove(v->step, v->step + 1, v->nd * sizeof(i64));
}

static double entry(const View *a, i64 i, i64 j) { return *(const double *)(a->at + i * a->step[0] + j * a->step[1]); }

static int sparse(const Tape *t, const View *a) {
    i64 count = 0;
    if (known(t, a->at) || a->item != 8) return 0;
    for (i64 i = 0; i < a->shape[0]; i++) for (i64 j = 0; j < a->shape[1]; j++) count += entry(a, i, j) != 0.0;
    return count <= SPARSE_PART * entries(a);
}

/* Write down a product with a constant matrix a that is mostly zero, two entries of a row at once, and at once rows
 * that go on as the one before them; see _replay.c. */
static int sparse_product(Tape *t, View o, View a, View b) {
    i64 most = a.shape[0], pairs = 0, before = 0;
    for (i64 i = 0; i < a.shape[0]; i++) for (i64 j = 0; j < a.shape[1]; j++) most += entry(&a, i, j) != 0.0;
    View table = {NULL, sizeof(Pair), 1, {most}, {0}};
    if (place(t, &table, FIXED)) return -1;
    Pair *all = (Pair *)table.at;
    for (i64 i = 0; i < a.shape[0]; i++) {
        i64 found = 0, last = pairs;
        for (i64 j = 0; j < a.shape[1]; j++) {
            const double x = entry(&a, i, j);
            if (x == 0.0 && (found || j + 1 < a.shape[1])) continue; /* one at least: it sets out */
            Pair *one = &all[last + found / 2];
            if (found % 2 == 0) *one = (Pair){{0.0, 0.0}, {0, j * b.step[0]}, i * o.step[0], found == 0, 1};
            one->weight[found % 2] = x; one->from[found % 2] = j * b.step[0];
            found++;
        }
        if (all[last].weight[0] == 0.0) all[last].sets = 2;
        pairs = last + (found + 1) / 2;
        int goes_on = i > 0 && pairs - last == last - before;
        for (const Pair *one = all + before; one < all + last && goes_on; one++) {
            const Pair *other = one + (last - before);
            const i64 ahead = one->rows * b.step[0];
            goes_on = one->sets == other->sets && (one->sets == 2 || !memcmp(one->weight, other->weight, sizeof one->weight)) &&
                      (one->sets == 2 || (other->from[0] == one->from[0] + ahead && other->from[1] == one->from[1] + ahead));
        }
        if (!goes_on) { before = last; continue; }
        for (i64 k = before; k < last; k++) all[k].rows++;
        pairs = last;
    }
    for (int x = 0; x < o.item / 8; x++) {
        Op op = {sparse_code, 2, {pairs, o.shape[1]}, {part(o, x).at, part(b, x).at, table.at}, {{o.step[0], o.step[1]}, {b.step[0], b.step[1]}}, 0};
        if (append(t, &op)) return -1;
    }
    return 0;
}

/* matmul(out or None, a, b) -> out */
static PyObject *matmul(Tape *t, PyObject *const *args, Py_ssize_t count) {
    View a, b, o, s;
    if (count != 3) return misused("matmul");
    if (operand(t, args[1], &a) || operand(t, args[2], &b)) return NULL;
    const int row = a.nd == 1, column = b.nd == 1, given = args[0] != Py_None;
    if (!a.nd || !b.nd || a.nd > MOST - 2 || b.nd > MOST - 2 || a.item < 8 || b.item < 8) return refused(t, "a product of such matrices");
    if (row) insert(&a, 0);
    if (column) insert(&b, 1);
    if (a.shape[a.nd - 1] != b.shape[b.nd - 2]) return refused(t, "shapes differ");
    View batch = b;
    s = a; s.nd -= 2; batch.nd -= 2;
    if (broadcast(t, &s, &batch)) return NULL;
    s.item = a.item > b.item ? a.item : b.item;
    if (!row) s.shape[s.nd++] = a.shape[a.nd - 2];
    if (!column) s.shape[s.nd++] = b.shape[b.nd - 1];
    o = s;
    if (given ? operand(t, args[0], &o) : place(t, &o, 0)) return NULL;
    if (given && (o.item != s.item || !same_shape(&o, &s) || !writeable(args[0]) || !known(t, o.at) || overlap(&o, &a) || overlap(&o, &b)))
        return refused(t, "a product in place");
    PyObject *out = given ? Py_NewRef(args[0]) : array_of(t, &o);
    if (!out) return NULL;
    int failed = 0;
    if (column) insert(&o, o.nd);
    if (row) insert(&o, o.nd - 1);
    widen(&a, &o); widen(&b, &o);
    while (o.nd > 2 && (o.shape[0] == 1 || (o.nd == 3 && !b.step[0] && a.shape[0] == o.shape[0] && goes_on(&o) && goes_on(&a)))) {
        b.shape[0] = 1;
        drop(&o); drop(&a); drop(&b);
    }
    if (o.nd == 2 && !row && !column && entries(&o) && a.shape[1] && (sparse(t, &a) || sparse(t, &b))) {
        if (!sparse(t, &a)) { View c = a; a = b; b = c; transpose(&o); transpose(&a); transpose(&b); }
        failed = sparse_product(t, o, a, b);
    } else {
        const int both = a.item == 16 && b.item == 16;
        failed = product(t, part(o, 0), part(a, 0), part(b, 0), 0) || (both && product(t, part(o, 0), part(a, 1), part(b, 1), -1)) ||
                 (o.item == 16 && product(t, part(o, 1), part(a, b.item == 8), part(b, 1), 0)) ||
                 (both && product(t, part(o, 1), part(a, 1), part(b, 0), 1));
    }
    if (failed) Py_CLEAR(out);
    return out;
}

/* row_products(a, rows, b, rows, groups) -> products of rows, or sums of so many groups of them */
static PyObject *row_products(Tape *t, PyObject *const *args, Py_ssize_t count) {
    View v[4];
    const i64 groups = count == 5 ? PyLong_AsLongLong(args[4]) : 0;
    if (groups < 1) return misused("row_products");
    for (int k = 0; k < 4; k++) if (k % 2 ? viewed(t, args[k], &v[k]) : operand(t, args[k], &v[k])) return NULL;
    for (int k = 0; k < 4; k += 2) {
        if (v[k].nd != 2 || v[k].item != 8 || v[k + 1].nd != 1 || v[k + 1].step[0] != 8 || v[k].shape[1] != v[0].shape[1] ||
            v[k + 1].shape[0] != v[1].shape[0] || v[1].shape[0] % groups) return refused(t, "products of such rows");
        if (v[k].step[1] != 8 && copied(t, &v[k], copy_d_code, 8)) return NULL;
    }
    const i64 products = v[1].shape[0], rows = products / groups, n = v[0].shape[1];
    View o = {NULL, 8, 2, {rows, n}, {0}}, table = {NULL, sizeof(RowProduct), 1, {products}, {0}};
    if (place(t, &o, 0) || place(t, &table, FIXED)) return NULL;
    for (i64 k = 0; k < products; k++) {
        RowProduct *one = (RowProduct *)table.at + k;
        *one = (RowProduct){{0}, 8 * n * (k / groups), k % groups == 0};
        for (int x = 0; x < 4; x += 2) {
            const i64 row = ((const i64 *)v[x + 1].at)[k % groups * rows + k / groups];
            if (row < 0 || row >= v[x].shape[0]) return refused(t, "rows beyond a matrix");
            one->from[x / 2] = row * v[x].step[0];
        }
    }
    Op op = {products_code, 2, {products, n}, {o.at, v[0].at, v[2].at, table.at}, {{0}}, 0};
    PyObject *out = array_of(t, &o);
    if (out && append(t, &op)) Py_CLEAR(out);
    return out;
}

/* resolve(code, a, b or nothing) -> result: matrices batch by batch; see _resolve.c */
static PyObject *resolved(Tape *t, PyObject *const *args, Py_ssize_t count) {
    View v[3] = {{0}}, o = {NULL, 8, 0, {0}, {0}};
    const int n = (int)count - 1, code = n > 0 ? (int)PyLong_AsLong(args[0]) : -1;
    if (code < factor_code || code > modes_code || n != 1 + (code == solve_code)) return misused("resolve");
    for (int k = 1; k <= n; k++) {
        if (operand(t, args[k], &v[k])) return NULL;
        if (v[k].nd < 2 || v[k].nd > 4 || v[k].item < 8 || v[k].item != v[1].item) return refused(t, "such matrices");
        View batch = v[k];
        batch.nd -= 2;
        if (broadcast(t, &o, &batch)) return NULL;
    }
    const i64 rows = v[n].shape[v[n].nd - 2], columns = v[n].shape[v[n].nd - 1], all = 2 * rows + 2; /* of factors */
    if (code == solve_code ? v[1].shape[v[1].nd - 2] != all : code != basis_code && rows != columns) return refused(t, "shapes differ");
    o.item = v[1].item;
    o.shape[o.nd++] = code == factor_code ? all : rows + (code == modes_code);
    o.shape[o.nd++] = code == factor_code ? (rows + 3) / 4 * 4 : code == solve_code ? columns : rows;
    if (place(t, &o, 0)) return NULL;
    Op op = {code, 4, {rows, columns, 1, 1}, {0}, {{0}}, o.item / 8};
    v[0] = o;
    for (int k = 0; k <= n; k++) {
        widen(&v[k], &o);
        op.at[k] = v[k].at;
        for (int d = 0; d < o.nd; d++) op.step[k][(d + 2) % o.nd] = v[k].step[d];
    }
    for (int d = 0; d < o.nd - 2; d++) op.shape[2 + d] = o.shape[d];
    PyObject *out = array_of(t, &o);
    if (out && entries(&o) && append(t, &op)) Py_CLEAR(out);
    return out;
}

/* ---------------------------------------------------------------- what is needed */

/* call(number, memory...): a call of Python that reads and writes such memory */
static PyObject *call(Tape *t, PyObject *const *args, Py_ssize_t count) {
    for (Py_ssize_t k = 1; k < count; k++) {
        View v;
        if (viewed(t, args[k], &v)) return NULL;
        Op uses = {uses_code, 0, {0}, {v.at}, {{0}}, 0};
        if (append(t, &uses)) return NULL;
    }
    Op op = {call_code, 0, {0}, {0}, {{0}}, count ? PyLong_AsLongLong(args[0]) : -1};
    return PyErr_Occurred() || append(t, &op) ? NULL : Py_NewRef(Py_None);
}

/* live(outputs...) -> a byte for each operation: whether outputs, inputs or calls need it; and the memory of those */
static PyObject *live(Tape *t, PyObject *const *args, Py_ssize_t count) {
    PyObject *found = PyByteArray_FromStringAndSize(NULL, t->count);
    if (!found) return NULL;
    char *kept = PyByteArray_AsString(found);
    memset(kept, 0, t->count);
    for (i64 k = 0; k < t->n_pieces; k++) { t->pieces[k].read = 0; t->pieces[k].flags &= ~ALIVE; }
    for (Py_ssize_t k = 0; k < count; k++) {
        Piece *piece = piece_of(t, args[k]);
        if (piece) piece->flags |= ALIVE;
    }
    for (int more = 1; more;) /* what an earlier operation reads, a later one of the round before writes */
        for (i64 i = t->count - 1, before = more = 0; i >= 0; i--) {
            before = kept[i];
            const Op *o = &t->ops[i];
            const int32_t *of = t->touched[i].of;
            Piece *piece = of[0] < 0 ? NULL : &t->pieces[of[0]];
            if (o->code == call_code) kept[i] = 1;
            else if (o->code == uses_code) { if (piece) piece->read = 1; }
            else if (piece->flags & (ALIVE | INPUT)) kept[i] = 1;
            else kept[i] |= piece->read;
            for (int k = 1, n = kept[i] ? (int)strlen(KINDS[o->code].kinds) : 0; k < n; k++)
                if (of[k] >= 0) t->pieces[of[k]].read = 1;
            more |= kept[i] != before;
        }
    i64 n = 0;
    for (i64 i = 0; i < t->count; i++) {
        const Piece *piece = t->touched[i].of[0] < 0 ? NULL : &t->pieces[t->touched[i].of[0]];
        if (piece && piece->item == 1 && !(piece->flags & (ALIVE | USED))) { /* NumPy itself asks nobody before it reads it, as in b[c > 0] */
            Py_DECREF(found);
            return refused(t, "a condition that only others read");
        }
        if (kept[i]) t->ops[n++] = t->ops[i];
    }
    t->count = n; t->ended = 1;
    return Py_BuildValue("NN", found, PyMemoryView_FromMemory((char *)t->ops, n * sizeof(Op), PyBUF_READ));
}

/* ---------------------------------------------------------------- arrays that write down what is done with them */

static _Thread_local Tape *recording; /* of this thread */

/* Have a tape, or none, write down what this thread does with arrays. */
PyObject *record(PyObject *module, PyObject *tape) {
    PyObject *before = (PyObject *)recording;
    recording = tape == Py_None ? NULL : (Tape *)Py_NewRef(tape);
    Py_XDECREF(before);
    Py_RETURN_NONE;
}

static PyObject *call_method(PyObject *a, const char *name, PyObject *args, PyObject *how) {
    PyObject *method = PyObject_GetAttrString(a, name), *found = method ? PyObject_Call(method, args, how) : NULL;
    Py_XDECREF(method);
    return found;
}

static PyObject *copied_to(PyObject *out, PyObject *a) {
    PyObject *given[] = {out, a};
    return applied(recording, copy_d_code, copy_D_code, given, 2);
}

/* a.__array_ufunc__(ufunc, method, *inputs, out=..., ...) */
static PyObject *ufunc(PyObject *a, PyObject *args, PyObject *how) {
    PyObject *codes = NULL, *out = NULL, *found, *given[OPERANDS];
    Py_ssize_t count = PyTuple_Size(args), others = how ? PyDict_Size(how) : 0;
    if (others == 1) out = PyDict_GetItemString(how, "out");
    if (recording && others == (out != NULL) && count > 2 && count <= OPERANDS + 1 &&
        !PyUnicode_CompareWithASCIIString(PyTuple_GetItem(args, 1), "__call__"))
        codes = PyDict_GetItemWithError(recording->codes, PyTuple_GetItem(args, 0));
    if (codes) {
        given[0] = out ? PyTuple_GetItem(out, 0) : Py_None;
        for (Py_ssize_t k = 2; k < count; k++) given[k - 1] = PyTuple_GetItem(args, k);
        int real = (int)PyLong_AsLong(PyTuple_GetItem(codes, 0)), complex = (int)PyLong_AsLong(PyTuple_GetItem(codes, 1));
        found = real == matmul_code ? matmul(recording, given, 3) : applied(recording, real, complex, given, (int)count - 1);
        if (found != Py_NotImplemented) return found;
        Py_DECREF(found);
    }
    return PyErr_Occurred() ? NULL : call_method(a, "_rare_ufunc", args, how);
}

/* Return a view of some places; None if they are not plainly numbered. */
static PyObject *places(PyObject *a, PyObject *key) {
    int several = PyTuple_Check(key), whole = 0;
    Py_ssize_t n = several ? PyTuple_Size(key) : 1;
    PyObject *all = recording ? PyTuple_New(n + 1) : NULL;
    for (Py_ssize_t k = 0; k < n && all; k++) {
        PyObject *one = several ? PyTuple_GetItem(key, k) : key;
        whole = whole || one == Py_Ellipsis;
        int number = PyIndex_Check(one) && !PyBool_Check(one) && !PyObject_TypeCheck(one, array);
        if (number || PySlice_Check(one) || one == Py_None || one == Py_Ellipsis)
            PyTuple_SetItem(all, k, Py_NewRef(one));
        else Py_CLEAR(all);
    }
    if (!all) return PyErr_Occurred() ? NULL : Py_NewRef(Py_None);
    PyTuple_SetItem(all, n, Py_NewRef(Py_Ellipsis)); /* a single entry comes as an array too */
    PyObject *found = ((binaryfunc)PyType_GetSlot(array, Py_mp_subscript))(a, whole ? key : all);
    Py_DECREF(all);
    return found;
}

/* a[key] */
static PyObject *taken(PyObject *a, PyObject *key) {
    PyObject *found = places(a, key);
    if (found == Py_None) { Py_DECREF(found); return PyObject_CallMethod(a, "_rare_take", "(O)", key); }
    const Py_ssize_t n = PyTuple_Check(key) ? PyTuple_Size(key) : 0;
    if (!found || ((const Array *)found)->nd || key == Py_Ellipsis || (n && PyTuple_GetItem(key, n - 1) == Py_Ellipsis)) return found;
    PyObject *value = copied_to(Py_None, found); /* an entry is a value */
    Py_DECREF(found);
    return value;
}

/* a[key] = value */
static int put(PyObject *a, PyObject *key, PyObject *value) {
    if (!value) { PyErr_SetString(PyExc_ValueError, "arrays keep their entries"); return -1; }
    PyObject *found = places(a, key), *done = NULL;
    if (found == Py_None) done = PyObject_CallMethod(a, "_rare_put", "(OO)", key, value);
    else if (found) done = copied_to(found, value);
    Py_XDECREF(found); Py_XDECREF(done);
    return done ? 0 : -1;
}

/* a.copy(...) */
static PyObject *copy(PyObject *a, PyObject *args, PyObject *how) {
    return recording ? copied_to(Py_None, a) : call_method(a, "_refuse", args, how);
}

static PyMethodDef WRITTEN_METHODS[] = {
    {"copy", (PyCFunction)(void (*)(void))copy, METH_VARARGS | METH_KEYWORDS, "Write down a copy."},
    {"__array_ufunc__", (PyCFunction)(void (*)(void))ufunc, METH_VARARGS | METH_KEYWORDS, "Write down an operation."},
    {NULL, NULL, 0, NULL},
};
static PyType_Slot WRITTEN_SLOTS[] = {
    {Py_mp_subscript, taken}, {Py_mp_ass_subscript, put}, {Py_tp_methods, WRITTEN_METHODS},
    {Py_tp_doc, "What arrays write down by themselves."}, {0, NULL},
};
static PyType_Spec WRITTEN = {"hfsim.maths._replay.Written", 0, 0, Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE, WRITTEN_SLOTS};
PyObject *written_type(PyObject *module) {
    PyObject *of = PyImport_ImportModule("numpy._core._multiarray_umath");
    PyObject *offer = of ? PyObject_GetAttrString(of, "_ARRAY_API") : NULL;
    numpy = offer ? PyCapsule_GetPointer(offer, NULL) : NULL;
    Py_XDECREF(of); Py_XDECREF(offer);
    if (!numpy) return NULL;
    const unsigned version = ((unsigned (*)(void))numpy[VERSION])();
    if (version != 0x1000009 && version != 0x2000000) { /* of NumPy 1 and 2, which begin alike */
        PyErr_SetString(PyExc_ImportError, "NumPy has another binary interface");
        return NULL;
    }
    array = numpy[TYPE];
    return PyType_FromModuleAndSpec(module, &WRITTEN, NULL);
}

/* ---------------------------------------------------------------- Python */

static PyObject *made(Tape *t, PyObject *const *args, Py_ssize_t count) {
    View v = {NULL, 8, 0, {0}, {0}};
    if (count < 2 || !PyTuple_Check(args[0]) || (v.nd = (int)PyTuple_Size(args[0])) > MOST) return refused(t, "such an array");
    for (int d = 0; d < v.nd; d++) v.shape[d] = PyLong_AsLongLong(PyTuple_GetItem(args[0], d));
    v.item = PyLong_AsLongLong(args[1]);
    if (PyErr_Occurred() || place(t, &v, count > 2 ? FIXED | INPUT : 0)) return NULL;
    return array_of(t, &v);
}

static PyObject *knows(Tape *t, PyObject *a) {
    View v;
    if (viewed(t, a, &v)) return NULL;
    return PyBool_FromLong(known(t, v.at) || !entries(&v));
}

static PyObject *waive(Tape *t, PyObject *a) {
    Piece *piece = piece_of(t, a);
    if (piece) piece->flags |= USED;
    Py_RETURN_NONE;
}

static PyObject *cut(Tape *t, PyObject *none) {
    t->program++;
    t->n_left = 0;
    return PyLong_FromLongLong(t->count);
}

static PyObject *keep(Tape *t, PyObject *count) {
    i64 n = PyLong_AsLongLong(count);
    if (PyErr_Occurred()) return NULL;
    if (n < t->count) t->count = n;
    Py_RETURN_NONE;
}

static Py_ssize_t length(Tape *t) { return t->count; }

static int begin(Tape *t, PyObject *args, PyObject *how) {
    PyObject *given[5];
    if (t->type || !PyArg_ParseTuple(args, "OOOO!O!", given, given + 1, given + 2, &PyTuple_Type, given + 3, &PyDict_Type, given + 4)) return -1;
    t->type = Py_NewRef(given[0]); t->refused = Py_NewRef(given[1]); t->copy = Py_NewRef(given[2]);
    t->dtypes = Py_NewRef(given[3]); t->codes = Py_NewRef(given[4]);
    return (t->constants = PyDict_New()) ? 0 : -1;
}

static void end(Tape *t) {
    PyTypeObject *type = Py_TYPE((PyObject *)t);
    Py_XDECREF(t->type); Py_XDECREF(t->refused); Py_XDECREF(t->copy); Py_XDECREF(t->constants); Py_XDECREF(t->dtypes); Py_XDECREF(t->codes);
    for (int k = 0; k < t->n_blocks; k++) { free(t->blocks[k].base); free(t->blocks[k].piece); }
    free(t->ops); free(t->touched); free(t->pieces); free(t->left);
    ((freefunc)PyType_GetSlot(type, Py_tp_free))(t);
    Py_DECREF(type);
}

#define FAST(f) (PyCFunction)(void (*)(void)) f, METH_FASTCALL
static PyMethodDef METHODS[] = {
    {"new", FAST(made), "Return an array of a shape and an item size, an input if anything more is told."},
    {"apply", FAST(apply), "Write down an elementwise operation; return its result."},
    {"reduce", FAST(reduced), "Write down a reduction; return its result."},
    {"join", FAST(joined), "Write down how arrays are joined; return the result."},
    {"matmul", FAST(matmul), "Write down a product of matrices; return its result."},
    {"row_products", FAST(row_products), "Write down products of rows; return them, or sums of them."},
    {"resolve", FAST(resolved), "Write down an operation on matrices; return what it writes."},
    {"call", FAST(call), "Write down a call of Python."},
    {"live", FAST(live), "Keep the operations that lead to outputs; the last thing to be asked for."},
    {"knows", (PyCFunction)knows, METH_O, "Return whether an array lies in the memory."},
    {"waive", (PyCFunction)waive, METH_O, "Take note that no operation need read a condition."},
    {"cut", (PyCFunction)cut, METH_NOARGS, "End a program; return the number of operations."},
    {"keep", (PyCFunction)keep, METH_O, "Forget operations but for the first."},
    {NULL, NULL, 0, NULL},
};
static PyType_Slot SLOTS[] = {
    {Py_tp_init, begin}, {Py_tp_dealloc, end},
    {Py_tp_methods, METHODS}, {Py_mp_length, length}, {Py_tp_doc, "Memory, and the operations on it."}, {0, NULL},
};
static PyType_Spec SPEC = {"hfsim.maths._replay.Tape", sizeof(Tape), 0, Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE, SLOTS};

PyObject *tape_type(PyObject *module) { return PyType_FromModuleAndSpec(module, &SPEC, NULL); }
