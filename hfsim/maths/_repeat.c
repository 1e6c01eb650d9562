/* Repeats steps of a method (hfsim/integrators/_ordinary.py): as long as nothing is out of the ordinary, without Python. */
#include "_replay.h"
#include <math.h>
#include <string.h>

/* Whether an iteration has converged (1) or failed (-1) with a correction; see Ending in integrators/_ending.py. */
typedef struct { double goal, near, last_digit, beyond, before, last, rate; } Ending;
static int ended(Ending *e, int k, double change, double size) {
    double ratio = change / e->last, held = 0.5 * e->rate;
    e->rate = k <= 1 || !(held > ratio) ? ratio : held;
    int settled = k > 0 && e->rate < 1.0 && change * (0.05 > e->rate ? 0.05 : e->rate) < e->goal * (1.0 - e->rate);
    int rounding = size < e->near && k > 2 && ratio > 0.9;
    int nothing = size < e->last_digit && change < e->near; /* in very short steps velocities change by more */
    if (change < 0.05 * e->goal || settled || rounding || nothing) return 1;
    if (!(change < e->beyond) || (k > 3 && change > 0.8 * e->before)) return -1;
    e->before = e->last; e->last = change;
    return 0;
}

/* What steps are put together from, what they work on, and what is told of them: see integrators/_ordinary.py. */
enum { START, GUESS, RENEW, REACH, PREPARE, CORRECT, SMALL, FINITE, STAGE, END, CLOSER, STEADIER, LOOK, COUNT, PROGRAMS };
enum { TIME, LENGTH, Q, V, FIRST, STAGES, CHANGE, SIZE, SCALE, Q_END, V_END, SERIES, ERROR, RATE_ERROR, FREQUENCY, TAKEN,
       ROWS, ROW, FOUND, MISS, SLIP, Q_CLOSED, V_CLOSED, POSITIVE, Q_LOOKED, V_LOOKED, FARTHEST, RULE, STATE, BEFORE, TAKEN_BEFORE, KEPT, ARRAYS };
typedef struct {
    double goal, near, last_digit, linear, most, tolerance, reach, target, power, faint, rungs, end, resolved, stiff, serves, serves_well, shrunk,
        steady, regrowth, at_end, rounding, closings, turned, longest, growth[][2];
} Rule;
typedef struct { double known, old, served, cap, wish, rejected, ready, fastest, iterations, begun, renewed, total, converged, made; } State;
typedef struct { Py_buffer program[PROGRAMS], array[ARRAYS]; PyObject *calls; double *at[ARRAYS]; } March;

static int part(const March *m, int k) { return replay(&m->program[k], m->calls); }

/* Try a step of an explicit method, stage after stage; the first one is its start. */
static int staged(const March *m) {
    State *s = (State *)m->at[STATE];
    const i64 width = m->array[ROW].len, n = m->array[Q].len;
    char *row = (char *)m->at[ROWS], *end = row + m->array[ROWS].len, *stage = (char *)m->at[STAGES];
    memset(stage, 0, m->array[STAGES].len);
    if (s->known) { memcpy(stage, m->at[FIRST], n); stage += n; row += width; }
    for (s->total += (double)((end - row) / width); row < end; row += width, stage += n) {
        memcpy(m->at[ROW], row, width);
        if (PyErr_CheckSignals() || part(m, STAGE)) return -1;
        memcpy(stage, m->at[FOUND], n);
    }
    memcpy(m->at[FIRST], m->at[STAGES], n);
    s->known = s->converged = 1;
    return part(m, END);
}

/* Try a step: guess its stages, take the derivative anew if that is old, correct until that ends. */
static int attempted(const March *m) {
    const Rule *r = (Rule *)m->at[RULE];
    State *s = (State *)m->at[STATE];
    const double h = *m->at[LENGTH], *change = m->at[CHANGE], *size = m->at[SIZE];
    int k = 0, outcome = 0;
    if (m->array[ROWS].len) return staged(m);
    if (s->known == 0) { if (part(m, START)) return -1; s->begun++; }
    if (s->known < 2 && part(m, GUESS)) return -1;
    s->known = 1;
    if (s->old) {
        s->ready = NAN; s->old = s->served = 0; s->renewed++;
        if (part(m, RENEW)) return -1;
        s->fastest = *m->at[FREQUENCY];
        if (!isfinite(s->fastest)) { tell_failure("the derivative is not finite"); return -1; }
    }
    if (part(m, REACH) || (s->ready != h && part(m, PREPARE))) return -1;
    s->ready = h;
    const double scale = *m->at[SCALE];
    Ending e = {r->goal * scale, r->near * scale, r->last_digit * scale, 3e2 * scale, HUGE_VAL, HUGE_VAL, HUGE_VAL};
    while (!outcome && k < r->most) {
        if (PyErr_CheckSignals() || part(m, CORRECT)) return -1;
        const double found = *size;
        if (part(m, found < r->linear ? SMALL : FINITE)) return -1;
        outcome = ended(&e, k++, *change, found);
    }
    s->iterations = k; s->total += k; s->converged = outcome > 0;
    return outcome > 0 ? part(m, END) : 0;
}

/* Move the end of a step onto the constraints as `Projection` does; return where it is then, -1 where that is not plain. */
static int closed(const March *m) {
    const Rule *r = (Rule *)m->at[RULE];
    int k = 0;
    if (r->closings == 0.0) return Q_END;
    for (; !(*m->at[MISS] <= r->rounding) && k < r->closings; k++) if (part(m, CLOSER)) return -1;
    if (k == r->closings) return -1;
    if (*m->at[SLIP] > r->rounding) return part(m, STEADIER) ? -1 : Q_CLOSED;
    return k ? -1 : Q_END;
}

/* Whether a state can be gone on from. */
static int sound(const March *m, int at) {
    const i64 n = m->array[Q].len / 8, *positive = (i64 *)m->at[POSITIVE];
    double none = 0.0;
    for (i64 i = 0; i < n; i++) none += 0.0 * m->at[at][i] + 0.0 * m->at[at + 1][i];
    for (i64 i = 0; i < m->array[POSITIVE].len / 8; i++) if (!(m->at[at][positive[i]] > 0.0)) return 0;
    return none == 0.0;
}

/* Whether angles turn far away from what is known of them in a step that ends there. */
static int strays(const March *m, int at) {
    const i64 n = m->array[Q_LOOKED].len;
    memcpy(m->at[Q_LOOKED], m->at[at], n); memcpy(m->at[V_LOOKED], m->at[at + 1], n);
    return part(m, LOOK) || !(*m->at[FARTHEST] <= ((Rule *)m->at[RULE])->turned);
}

/* Return the factor on a step of such an error, over the tolerance; and go to another length, as the end is near or not. */
static double factor(const Rule *r, double error, double most) {
    const double wanted = pow(r->target / (error > r->faint ? error : r->faint), r->power), growth = wanted < most ? wanted : most;
    return pow(2.0, rint(r->rungs * log2(growth > 0.1 ? growth : 0.1)) / r->rungs);
}
static void lengthen(const March *m, double wish) {
    const Rule *r = (Rule *)m->at[RULE];
    const double rest = r->end - *m->at[TIME];
    ((State *)m->at[STATE])->wish = wish = wish < r->longest ? wish : r->longest;
    *m->at[LENGTH] = rest <= wish * (1.0 + 1e-9) ? rest : rest < 2.0 * wish ? 0.5 * rest : wish;
}

/* Write down a step that is kept, and go on to the next one. */
static void kept(const March *m, int at, double error) {
    const Rule *r = (Rule *)m->at[RULE];
    State *s = (State *)m->at[STATE];
    double *t = m->at[TIME];
    const double h = *m->at[LENGTH], most = s->cap / h;
    const i64 state = m->array[Q].len, series = m->array[SERIES].len;
    char *row = (char *)m->at[KEPT] + (i64)s->made++ * (24 + 2 * state + series);
    const int growths = (int)((m->array[RULE].len - sizeof *r) / sizeof *r->growth);
    int k = 0;
    while (k + 1 < growths && s->iterations > r->growth[k][0]) k++;
    const double growth = factor(r, error, r->growth[k][1] < most ? r->growth[k][1] : most);
    memcpy(row, &s->rejected, 8); memcpy(row + 8, t, 8); memcpy(row + 16, &h, 8);
    memcpy(row + 24, m->at[at], state); memcpy(row + 24 + state, m->at[at + 1], state); memcpy(row + 24 + 2 * state, m->at[SERIES], series);
    memcpy(m->at[Q], m->at[at], state); memcpy(m->at[V], m->at[at + 1], state);
    if (r->at_end) memcpy(m->at[FIRST], (char *)m->at[STAGES] + (i64)(r->at_end - 1) * state, state);
    s->known = r->at_end > 0; s->served++; s->rejected = 0.0;
    s->cap *= m->array[ROWS].len ? pow(r->regrowth, s->served) : r->regrowth;
    s->old = s->served >= r->serves || s->iterations > r->serves_well;
    *t = h == r->end - *t ? r->end : *t + h;
    lengthen(m, h < 0.5 * s->wish ? s->wish : h * (growth < 0.2 ? 0.2 : growth > 5.0 ? 5.0 : growth));
}

/* Go on to another attempt after one that is not kept; return whether it is not ordinary any more. */
static int refused(const March *m, double error) {
    const Rule *r = (Rule *)m->at[RULE];
    State *s = (State *)m->at[STATE];
    const double h = *m->at[LENGTH];
    if (s->rejected || !isfinite(error) || (!s->converged && !s->served && (!r->steady || h >= s->cap))) return 1;
    s->old = !s->converged;
    if (s->old && s->served) return 0; /* the same with a derivative of its own */
    const double growth = s->converged ? factor(r, error, HUGE_VAL) : r->shrunk;
    const double shorter = h * (growth < 0.1 ? 0.1 : growth > 0.9 ? 0.9 : growth);
    if (s->old) s->cap = r->shrunk * h;
    if (m->array[ROWS].len) { s->cap = shorter; s->served = 0.0; }
    s->rejected = 1.0;
    lengthen(m, shorter);
    return 0;
}

/* Make ordinary steps as long as there is room for them, and one more attempt; return whether there is that one. */
static int marched(const March *m) {
    const Rule *r = (Rule *)m->at[RULE];
    State *s = (State *)m->at[STATE];
    const i64 width = 24 + 2 * m->array[Q].len + m->array[SERIES].len, room = m->array[KEPT].len / width;
    for (int at;;) {
        memcpy(m->at[BEFORE], s, sizeof *s); memcpy(m->at[TAKEN_BEFORE], m->at[TAKEN], m->array[TAKEN].len);
        if (attempted(m)) return -1;
        const double error = s->converged ? (*m->at[ERROR] < r->reach * *m->at[RATE_ERROR] ? r->reach * *m->at[RATE_ERROR] : *m->at[ERROR]) / r->tolerance : 0.0;
        if (s->made == room) return 1;
        if (s->converged && error <= 1.0) {
            if ((at = closed(m)) < 0 || !sound(m, at) || strays(m, at)) return PyErr_Occurred() || part(m, END) ? -1 : 1;
            kept(m, at, error);
            if (part(m, COUNT)) return -1;
            if (s->made == room || *m->at[TIME] == r->end) return 0;
        } else if (refused(m, error)) return 1;
        if (s->old && (*m->at[LENGTH] * s->fastest > r->resolved) != (r->stiff != 0.0)) return 0;
    }
}

PyObject *march(PyObject *self, PyObject *args) {
    March m = {0};
    PyObject *programs, *arrays, *one;
    int failed = !PyArg_ParseTuple(args, "O!O!O!", &PyTuple_Type, &programs, &PyTuple_Type, &arrays, &PyList_Type, &m.calls), pending = -1;
    for (int k = 0; k < PROGRAMS && !failed; k++)
        failed = !(one = PyTuple_GetItem(programs, k)) || PyObject_GetBuffer(one, &m.program[k], PyBUF_SIMPLE);
    for (int k = 0; k < ARRAYS && !failed; k++) {
        failed = !(one = PyTuple_GetItem(arrays, k)) || PyObject_GetBuffer(one, &m.array[k], k == POSITIVE ? PyBUF_SIMPLE : PyBUF_WRITABLE);
        m.at[k] = m.array[k].buf;
    }
    if (!failed) pending = marched(&m);
    for (int k = 0; k < PROGRAMS; k++) PyBuffer_Release(&m.program[k]);
    for (int k = 0; k < ARRAYS; k++) PyBuffer_Release(&m.array[k]);
    return pending < 0 ? NULL : PyBool_FromLong(pending);
}
