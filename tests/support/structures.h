// SPDX-License-Identifier: MIT
// The three structures of the specification (docs/numerics.md) with M, R and K in closed form, exact discrete models of
// them with any sensors, random realizations, and the few matrix helpers the tests of the mechanics need. The end
// frequencies are written out, so that the truth does not come from the library.
#ifndef OKID_TEST_STRUCTURES_H
#define OKID_TEST_STRUCTURES_H

#include "tolerance.h"

#include <math.h>
#include <okid/okid.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { S_MAX = 10, S_NU = 10, S_NY = 20, S_NZ = 40 };

typedef struct structure_t {
    int n;
    double omega[2]; // lowest and highest undamped frequency, rad/s
    double alpha, beta, dt;
    okid_real_t M[S_MAX * S_MAX], R[S_MAX * S_MAX], K[S_MAX * S_MAX];
} structure_t;

/// Spring k between masses i and j (0-based); j < 0: ground.
static inline void s_spring(structure_t* s, int i, int j, double k) {
    s->K[i * s->n + i] += (okid_real_t)k;
    if (j < 0) return;
    s->K[j * s->n + j] += (okid_real_t)k;
    s->K[i * s->n + j] -= (okid_real_t)k;
    s->K[j * s->n + i] -= (okid_real_t)k;
}

/// R = alpha M + beta K with 1 % at both ends; the highest mode at 0.6 Nyquist.
static inline void s_finish(structure_t* s) {
    s->beta = 0.02 / (s->omega[0] + s->omega[1]);
    s->alpha = s->beta * s->omega[0] * s->omega[1];
    s->dt = 0.6 * 3.14159265358979323846 / s->omega[1];
    for (int i = 0; i < s->n * s->n; ++i) s->R[i] = (okid_real_t)(s->alpha * s->M[i] + s->beta * s->K[i]);
}

/// which: 1, 2 or 3.
static inline void s_make(structure_t* s, int which) {
    static const double ends[3][2] = {{68.86426677939865, 286.90262602996614},
                                      {52.599452937468186, 379.2531101037275},
                                      {56.41161902656004, 639.5726485326256}};
    static const double m1[] = {1.0, 0.8, 1.2}, k1[] = {3e4, 2e4, 2.5e4};
    static const double m2[] = {2.0, 1.5, 1.8, 1.2, 1.6, 1.0}, k2[] = {8e4, 6e4, 7e4, 5e4, 5.5e4, 4e4};
    memset(s, 0, sizeof *s);
    s->n = which == 1 ? 3 : which == 2 ? 6 : 10;
    memcpy(s->omega, ends[which - 1], sizeof s->omega);
    for (int i = 0; i < s->n; ++i) {
        const double mass = which == 1 ? m1[i] : which == 2 ? m2[i] : 4.0 - 0.2 * i;
        const double spring = which == 1 ? k1[i] : which == 2 ? k2[i] : 4e5 - 2e5 * i / 9;
        s->M[i * s->n + i] = (okid_real_t)mass;
        s_spring(s, i, i - 1, spring);
        if (which == 3 && i < 9) s->M[i * s->n + i + 1] = s->M[(i + 1) * s->n + i] = (okid_real_t)(0.05 * mass);
        if (which == 3 && i < 8) s_spring(s, i, i + 2, 3e4);
    }
    s_finish(s);
}

/// |a - b| / |b|, Frobenius.
static inline double s_error(const okid_real_t* a, const okid_real_t* b, int count) {
    double d = 0, size = 0;
    for (int i = 0; i < count; ++i) {
        d += ((double)a[i] - (double)b[i]) * ((double)a[i] - (double)b[i]);
        size += (double)b[i] * (double)b[i];
    }
    return size > 0 ? sqrt(d / size) : sqrt(d);
}

static inline double s_error_double(const double* a, const okid_real_t* b, int count) {
    double d = 0, size = 0;
    for (int i = 0; i < count; ++i) {
        d += (a[i] - (double)b[i]) * (a[i] - (double)b[i]);
        size += (double)b[i] * (double)b[i];
    }
    return sqrt(d / size);
}

static inline double s_uniform(uint64_t* state) {
    *state = *state * 6364136223846793005ULL + 1442695040888963407ULL;
    return (double)(*state >> 11) / 9007199254740992.0;
}

/// In place inverse of a (n x n) by Gauss and Jordan with row pivots. For the tests' own naive formulas.
static inline void s_invert(int n, double* a) {
    double b[S_MAX * S_MAX] = {0};
    for (int i = 0; i < n; ++i) b[i * n + i] = 1;
    for (int k = 0; k < n; ++k) {
        int pivot = k;
        for (int i = k + 1; i < n; ++i)
            if (fabs(a[k * n + i]) > fabs(a[k * n + pivot])) pivot = i;
        for (int j = 0; j < n; ++j) {
            const double x = a[j * n + k], y = b[j * n + k];
            a[j * n + k] = a[j * n + pivot];
            a[j * n + pivot] = x;
            b[j * n + k] = b[j * n + pivot];
            b[j * n + pivot] = y;
        }
        const double d = a[k * n + k];
        for (int j = 0; j < n; ++j) {
            a[j * n + k] /= d;
            b[j * n + k] /= d;
        }
        for (int i = 0; i < n; ++i) {
            const double f = a[k * n + i];
            if (i == k) continue;
            for (int j = 0; j < n; ++j) {
                a[j * n + i] -= f * a[j * n + k];
                b[j * n + i] -= f * b[j * n + k];
            }
        }
    }
    memcpy(a, b, sizeof(double) * (size_t)(n * n));
}

// ---- models ------------------------------------------------------------------------------------------------------------

typedef struct system_t {
    int n_x, n_u, n_y, n_z;
    double dt;
    int32_t input_dof[S_NU], output_dof[S_NY], sensing[S_NY];
    okid_real_t input_gain[S_NU], output_gain[S_NY];
    okid_real_t A[S_NZ * S_NZ], B[S_NZ * S_NU], C[S_NY * S_NZ], D[S_NY * S_NU];
    double scale; // a typical frequency: makes displacements and velocities of one size
} system_t;

static inline okid_model_t s_view(const system_t* m) {
    const okid_model_t view = {m->n_u, m->n_y, m->n_z, m->A, m->B, m->C, m->D, NULL};
    return view;
}

/// Forces and sensors, gains 1.
static inline void s_instrument(system_t* m, int n_u, const int32_t* input_dof, int n_y, const int32_t* output_dof,
                                const int32_t* sensing) {
    memset(m, 0, sizeof *m);
    m->n_u = n_u;
    m->n_y = n_y;
    memcpy(m->input_dof, input_dof, sizeof *input_dof * (size_t)n_u);
    memcpy(m->output_dof, output_dof, sizeof *output_dof * (size_t)n_y);
    memcpy(m->sensing, sensing, sizeof *sensing * (size_t)n_y);
    for (int j = 0; j < n_u; ++j) m->input_gain[j] = 1;
    for (int o = 0; o < n_y; ++o) m->output_gain[o] = 1;
}

/// Continuous model of an instrumented structure. @return the first status that is not OKID_OK
static inline okid_status_t s_continuous(const structure_t* s, system_t* m) {
    okid_real_t B_a[S_MAX * S_NU], C[3][S_NY * S_MAX];
    m->n_x = s->n;
    m->n_z = 2 * s->n;
    m->dt = s->dt;
    m->scale = sqrt(s->omega[0] * s->omega[1]);
    okid_status_t status = okid_mechanics_inputs(s->n, m->n_u, m->input_dof, m->input_gain, B_a);
    if (status != OKID_OK) return status;
    status = okid_mechanics_outputs(s->n, m->n_y, m->output_dof, m->output_gain, m->sensing, C[0], C[1], C[2]);
    if (status != OKID_OK) return status;
    const okid_mechanics_t truth = {s->n, m->n_u, m->n_y, s->M, s->R, s->K, B_a, C[0], C[1], C[2]};
    const size_t bytes = okid_mechanics_memsize(s->n, m->n_u);
    void* work = malloc(bytes);
    status = okid_mechanics_continuous(&truth, m->A, m->B, m->C, m->D, work, bytes);
    free(work);
    return status;
}

/// Continuous to discrete, in place.
static inline okid_status_t s_sample(system_t* m, int32_t hold) {
    system_t* c = malloc(sizeof *c);
    *c = *m;
    const okid_model_t view = s_view(c);
    const size_t bytes = okid_mechanics_hold_memsize(m->n_u, m->n_y, m->n_z);
    void* work = malloc(bytes);
    const okid_status_t status = okid_mechanics_c2d(&view, m->dt, hold, m->A, m->B, m->D, work, bytes);
    free(work);
    free(c);
    return status;
}

/// z -> H z with H = I - 2 v v^T / v^T v.
static inline void s_reflect(system_t* m, uint64_t* seed) {
    const int n = m->n_z;
    double v[S_NZ], size = 0;
    for (int i = 0; i < n; ++i) {
        v[i] = s_uniform(seed) - 0.5;
        size += v[i] * v[i];
    }
    for (int pass = 0; pass < 2; ++pass) { // rows of A and B; columns of A, C
        for (int j = 0; j < (pass == 0 ? n + m->n_u : n + m->n_y); ++j) {
            okid_real_t* x =
                pass == 0 ? (j < n ? m->A + j * n : m->B + (j - n) * n) : (j < n ? m->A + j : m->C + j - n);
            const int step = pass == 0 ? 1 : j < n ? n : m->n_y;
            double dot = 0;
            for (int i = 0; i < n; ++i) dot += v[i] * (double)x[i * step];
            for (int i = 0; i < n; ++i) x[i * step] = (okid_real_t)((double)x[i * step] - 2 * dot / size * v[i]);
        }
    }
}

/// z_i -> d_i z_i
static inline void s_rescale(system_t* m, const double* d) {
    const int n = m->n_z;
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) m->A[j * n + i] = (okid_real_t)((double)m->A[j * n + i] * d[i] / d[j]);
    for (int j = 0; j < m->n_u; ++j)
        for (int i = 0; i < n; ++i) m->B[j * n + i] = (okid_real_t)((double)m->B[j * n + i] * d[i]);
    for (int j = 0; j < n; ++j)
        for (int o = 0; o < m->n_y; ++o) m->C[j * m->n_y + o] = (okid_real_t)((double)m->C[j * m->n_y + o] / d[j]);
}

/// A random realization of the same system: states of one size first, then reflections with a stretch of up to 10 between.
static inline void s_scramble(system_t* m, uint64_t seed) {
    double d[S_NZ];
    for (int i = 0; i < m->n_z; ++i) d[i] = i < m->n_x ? m->scale : 1;
    s_rescale(m, d);
    for (int k = 0; k < 3; ++k) s_reflect(m, &seed);
    for (int i = 0; i < m->n_z; ++i) d[i] = pow(10, s_uniform(&seed) - 0.5);
    s_rescale(m, d);
    for (int k = 0; k < 3; ++k) s_reflect(m, &seed);
}

/// Root mean square of `count` numbers, `step` apart.
static inline double s_rms(const okid_real_t* x, int count, int step) {
    double sum = 0;
    for (int i = 0; i < count; ++i) sum += (double)x[i * step] * (double)x[i * step];
    return sqrt(sum / count);
}

/// One more pole pair (radius, angle in rad) or, with angle 0, one real pole, of random residues: about `size` times those
/// of the poles there are, in every channel.
static inline void s_add_pole(system_t* m, double radius, double angle, double size, uint64_t* seed) {
    const int old = m->n_z, add = angle > 0 ? 2 : 1, n = old + add;
    okid_real_t A[S_NZ * S_NZ] = {0}, B[S_NZ * S_NU];
    for (int j = 0; j < old; ++j) memcpy(A + j * n, m->A + j * old, sizeof *A * (size_t)old);
    A[old * n + old] = (okid_real_t)(radius * cos(angle));
    if (add == 2) {
        A[(old + 1) * n + old + 1] = A[old * n + old];
        A[(old + 1) * n + old] = (okid_real_t)(radius * sin(angle));
        A[old * n + old + 1] = -A[(old + 1) * n + old];
    }
    for (int j = 0; j < m->n_u; ++j) {
        memcpy(B + j * n, m->B + j * old, sizeof *B * (size_t)old);
        const double usual = 2 * size * s_rms(m->B + j * old, old, 1);
        for (int i = old; i < n; ++i) B[j * n + i] = (okid_real_t)(usual * (s_uniform(seed) - 0.5));
    }
    for (int o = 0; o < m->n_y; ++o) {
        const double usual = 2 * s_rms(m->C + o, old, m->n_y);
        for (int i = old; i < n; ++i) m->C[i * m->n_y + o] = (okid_real_t)(usual * (s_uniform(seed) - 0.5));
    }
    memcpy(m->A, A, sizeof m->A);
    memcpy(m->B, B, sizeof m->B);
    m->n_z = n;
}

#endif
