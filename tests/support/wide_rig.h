// SPDX-License-Identifier: MIT
// A discrete system with several inputs and outputs, not as many of one as of the other, and four known modes: what a
// dimension taken for another changes shows in it. The forces are correlated and of different sizes.
#ifndef WIDE_RIG_H
#define WIDE_RIG_H

#include "modal_rig.h"

#include <okid/types.h>

enum { WIDE_MODES = 4, WIDE_NZ = 8, WIDE_MOST = 4 };
#define WIDE_FS 200.0
static const double wide_frequency[WIDE_MODES] = {9.0, 22.0, 47.0, 71.0};
static const double wide_damping[WIDE_MODES] = {0.03, 0.02, 0.015, 0.025};

typedef struct wide_t {
    int n_u, n_y;
    double A[WIDE_NZ * WIDE_NZ], B[WIDE_NZ * WIDE_MOST], C[WIDE_MOST * WIDE_NZ], D[WIDE_MOST * WIDE_MOST];
} wide_t;

static inline void wide_make(wide_t* s, int n_u, int n_y) {
    uint64_t state = 91;
    memset(s, 0, sizeof *s);
    s->n_u = n_u;
    s->n_y = n_y;
    for (int k = 0; k < WIDE_MODES; ++k) {
        const double omega = 6.283185307179586 * wide_frequency[k], zeta = wide_damping[k];
        const double radius = exp(-zeta * omega / WIDE_FS), angle = omega * sqrt(1 - zeta * zeta) / WIDE_FS;
        double *first = s->A + 2 * k * (WIDE_NZ + 1), *second = first + WIDE_NZ;
        first[0] = second[1] = radius * cos(angle);
        second[0] = radius * sin(angle);
        first[1] = -second[0];
    }
    for (int i = 0; i < WIDE_NZ * n_u; ++i) s->B[i] = rig_uniform(&state) - 0.3;
    for (int i = 0; i < n_y * WIDE_NZ; ++i) s->C[i] = rig_uniform(&state) - 0.4;
    for (int i = 0; i < n_y * n_u; ++i) s->D[i] = rig_uniform(&state) - 0.5;
}

/// v = [u; y], (n_u + n_y) x count, with white noise of this size in the outputs.
static inline double* wide_record(const wide_t* s, int count, double noise, uint64_t seed) {
    const int m = s->n_u + s->n_y;
    double *v = malloc(sizeof *v * (size_t)count * (size_t)m), x[WIDE_NZ] = {0}, next[WIDE_NZ];
    uint64_t state = seed * 2654435761u + 12345;
    for (int n = 0; n < count; ++n) {
        double* sample = v + (size_t)n * (size_t)m;
        for (int j = 0; j < s->n_u; ++j) {
            sample[j] = (1 + j) * rig_normal(&state);
            for (int other = 0; other < j; ++other) sample[j] += 0.4 * sample[other];
        }
        for (int o = 0; o < s->n_y; ++o) {
            double y = noise * rig_normal(&state);
            for (int j = 0; j < s->n_u; ++j) y += s->D[j * s->n_y + o] * sample[j];
            for (int i = 0; i < WIDE_NZ; ++i) y += s->C[i * s->n_y + o] * x[i];
            sample[s->n_u + o] = y;
        }
        for (int i = 0; i < WIDE_NZ; ++i) {
            next[i] = 0;
            for (int j = 0; j < s->n_u; ++j) next[i] += s->B[j * WIDE_NZ + i] * sample[j];
            for (int j = 0; j < WIDE_NZ; ++j) next[i] += s->A[j * WIDE_NZ + i] * x[j];
        }
        memcpy(x, next, sizeof x);
    }
    return v;
}

/// Y_0 .. Y_last, n_y x n_u each, one after the other: D, C B, C A B ..
static inline void wide_markov(int n_u, int n_y, int n_z, const okid_real_t* A, const okid_real_t* B,
                               const okid_real_t* C, const okid_real_t* D, int last, double* out) {
    double x[WIDE_NZ * 2], next[WIDE_NZ * 2];
    for (int j = 0; j < n_u; ++j) {
        for (int o = 0; o < n_y; ++o) out[j * n_y + o] = (double)D[j * n_y + o];
        for (int i = 0; i < n_z; ++i) x[i] = (double)B[j * n_z + i];
        for (int k = 1; k <= last; ++k) {
            for (int o = 0; o < n_y; ++o) {
                double sum = 0;
                for (int i = 0; i < n_z; ++i) sum += (double)C[i * n_y + o] * x[i];
                out[(k * n_u + j) * n_y + o] = sum;
            }
            for (int i = 0; i < n_z; ++i) {
                next[i] = 0;
                for (int l = 0; l < n_z; ++l) next[i] += (double)A[l * n_z + i] * x[l];
            }
            memcpy(x, next, sizeof(double) * (size_t)n_z);
        }
    }
}

/// The true ones.
static inline void wide_truth(const wide_t* s, int last, double* out) {
    okid_real_t A[WIDE_NZ * WIDE_NZ], B[WIDE_NZ * WIDE_MOST], C[WIDE_MOST * WIDE_NZ], D[WIDE_MOST * WIDE_MOST];
    for (int i = 0; i < WIDE_NZ * WIDE_NZ; ++i) A[i] = (okid_real_t)s->A[i];
    for (int i = 0; i < WIDE_NZ * WIDE_MOST; ++i) B[i] = (okid_real_t)s->B[i];
    for (int i = 0; i < WIDE_MOST * WIDE_NZ; ++i) C[i] = (okid_real_t)s->C[i];
    for (int i = 0; i < WIDE_MOST * WIDE_MOST; ++i) D[i] = (okid_real_t)s->D[i];
    wide_markov(s->n_u, s->n_y, WIDE_NZ, A, B, C, D, last, out);
}

#endif
