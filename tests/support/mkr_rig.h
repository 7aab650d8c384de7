// SPDX-License-Identifier: MIT
// Runs okid_mkr_identify() on the systems of structures.h, and builds models from chosen residues, so that a test knows
// the c and b of every mode and can code a printed formula literally.
#ifndef OKID_TEST_MKR_RIG_H
#define OKID_TEST_MKR_RIG_H

#include "structures.h"

#include <complex.h>
#include <unity.h>

#define RIG_PI 3.14159265358979323846

static okid_mkr_t result; // of the last call; its arrays live in mkr_block
static union {
    double align;
    unsigned char bytes[1 << 20];
} mkr_block;

static inline okid_status_t mkr_run(const system_t* m, int n_x, int32_t hold) {
    const okid_mkr_config_t config = {n_x,           hold,          m->dt,          m->input_dof,
                                      m->input_gain, m->output_dof, m->output_gain, m->sensing};
    const okid_model_t view = s_view(m);
    const size_t bytes = okid_mkr_memsize(m->n_u, m->n_y, m->n_z, n_x);
    TEST_ASSERT_TRUE(bytes > 0 && bytes <= sizeof mkr_block);
    return okid_mkr_identify(&view, &config, &result, &mkr_block, bytes);
}

/// Exact discrete model of a structure, in a random realization.
static inline void mkr_system(const structure_t* s, system_t* m, int n_u, const int32_t* forces, int n_y,
                              const int32_t* sensors, const int32_t* kinds, int32_t hold, uint64_t seed) {
    s_instrument(m, n_u, forces, n_y, sensors, kinds);
    TEST_ASSERT_EQUAL(OKID_OK, s_continuous(s, m));
    TEST_ASSERT_EQUAL(OKID_OK, s_sample(m, hold));
    s_scramble(m, seed);
}

/// The forces of the specification and a sensor of one kind (or 3: mixed) at every degree of freedom.
static inline void mkr_standard(structure_t* s, system_t* m, int which, int kind, int32_t hold, uint64_t seed) {
    static const int32_t forces[3][3] = {{0}, {0, 3}, {0, 4, 9}};
    int32_t dof[S_MAX], kinds[S_MAX];
    s_make(s, which);
    for (int i = 0; i < s->n; ++i) {
        dof[i] = i;
        kinds[i] = kind == 3 ? i % 3 : kind;
    }
    mkr_system(s, m, which, forces[which - 1], s->n, dof, kinds, hold, seed);
}

static inline double error_M(const structure_t* s) { return s_error(result.M, s->M, s->n * s->n); }
static inline double error_K(const structure_t* s) { return s_error(result.K, s->K, s->n * s->n); }
static inline double error_R(const structure_t* s) { return s_error(result.R, s->R, s->n * s->n); }
static inline double error_normal(const structure_t* s) { return s_error(result.R_normal, s->R, s->n * s->n); }

/// All three matrices, both ways to R, to the accuracy asked for.
static inline void assert_exact(const structure_t* s) {
    TEST_ASSERT_TRUE(error_M(s) < TOLERANCE(1e-12, 5e-4));
    TEST_ASSERT_TRUE(error_K(s) < TOLERANCE(1e-12, 5e-4));
    TEST_ASSERT_TRUE(error_R(s) < TOLERANCE(2e-11, 2e-2));
    TEST_ASSERT_TRUE(error_normal(s) < TOLERANCE(2e-12, 1e-3));
}

// ---- modes with known residues -----------------------------------------------------------------------------------------

typedef struct residues_t {
    int modes;
    double complex lambda[S_MAX + 2], w[S_MAX + 2][S_MAX]; // w: columns of W, scaled as eq. (105)
    double complex c[S_MAX + 2][S_NY], b[S_MAX + 2][S_NU]; // C psi and psi^-1 B_c
} residues_t;

/// lambda and W of a structure with normal modes: w = phi / sqrt(2 i w_d), phi mass-normalised.
static inline void residues_of(const structure_t* s, residues_t* r) {
    okid_real_t f[S_MAX], zeta[S_MAX], re[S_MAX * S_MAX], im[S_MAX * S_MAX];
    const size_t bytes = okid_mechanics_memsize(s->n, 1);
    void* work = malloc(bytes);
    const okid_mechanics_t self = {.n_x = s->n, .M = s->M, .R = s->R, .K = s->K};
    okid_modes_t modes = {.frequency_hz = f, .damping_ratio = zeta, .shape_re = re, .shape_im = im};
    TEST_ASSERT_EQUAL(OKID_OK, okid_mechanics_modes(&self, &modes, work, bytes));
    TEST_ASSERT_EQUAL(s->n, modes.count);
    free(work);
    r->modes = s->n;
    for (int k = 0; k < s->n; ++k) {
        const double omega = 2 * RIG_PI * f[k], damped = omega * sqrt(1 - (double)zeta[k] * zeta[k]);
        double mass = 0;
        for (int i = 0; i < s->n; ++i)
            for (int j = 0; j < s->n; ++j) mass += (double)re[k * s->n + i] * s->M[j * s->n + i] * re[k * s->n + j];
        r->lambda[k] = -zeta[k] * omega + I * damped;
        for (int i = 0; i < s->n; ++i) r->w[k][i] = re[k * s->n + i] / sqrt(mass) / csqrt(2 * I * damped);
    }
}

/// c and b of the channels of m; gain: any complex number per mode, the free scale of an eigenvector.
static inline void residues_channels(residues_t* r, const system_t* m, double complex gain) {
    for (int k = 0; k < r->modes; ++k) {
        for (int o = 0; o < m->n_y; ++o)
            r->c[k][o] = gain * r->w[k][m->output_dof[o]] * cpow(r->lambda[k], m->sensing[o]);
        for (int j = 0; j < m->n_u; ++j) r->b[k][j] = r->w[k][m->input_dof[j]] / gain;
    }
}

/// The discrete model (force held) with these residues, in real modal states. D and the channels of m stay.
static inline void residues_model(const residues_t* r, system_t* m) {
    const int n = m->n_z = 2 * r->modes;
    memset(m->A, 0, sizeof m->A);
    for (int k = 0; k < r->modes; ++k) {
        const int i = 2 * k;
        const double complex mu = cexp(r->lambda[k] * m->dt), factor = (mu - 1) / r->lambda[k];
        m->A[i * n + i] = m->A[(i + 1) * n + i + 1] = (okid_real_t)creal(mu);
        m->A[(i + 1) * n + i] = (okid_real_t)cimag(mu);
        m->A[i * n + i + 1] = -(okid_real_t)cimag(mu);
        for (int j = 0; j < m->n_u; ++j) {
            m->B[j * n + i] = (okid_real_t)(2 * creal(r->b[k][j] * factor));
            m->B[j * n + i + 1] = (okid_real_t)(-2 * cimag(r->b[k][j] * factor));
        }
        for (int o = 0; o < m->n_y; ++o) {
            m->C[i * m->n_y + o] = (okid_real_t)creal(r->c[k][o]);
            m->C[(i + 1) * m->n_y + o] = (okid_real_t)cimag(r->c[k][o]);
        }
    }
}

/// out = (sign * 2 Re sum over the modes of w lambda^power w^T)^-1, or w^H where `hermitian`.
static inline void naive_sum(int n, int modes, const double complex* lambda, double complex w[][S_MAX], int power,
                             int hermitian, double sign, double* out) {
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
            double complex sum = 0;
            for (int k = 0; k < modes; ++k)
                sum += cpow(lambda[k], power) * w[k][i] * (hermitian ? conj(w[k][j]) : w[k][j]);
            out[j * n + i] = sign * 2 * creal(sum);
        }
    s_invert(n, out);
}

#endif
