// SPDX-License-Identifier: MIT
// PURPOSE  sums of 16-bit codes, and from them modes: structured observer, Markov parameters, ERA, modes
// METHOD   no Gram matrix (okid_structured_solve takes the sums themselves); observer and realization never meet, so they
//          share one memory, which also carries the written state. Deviations: parts.c
// REFERENCE docs/howto/port-to-a-board.md; paper eq. (36)-(54)
#include "identifier.h"

#include "parts.h"

#include <okid/modal.h>
#include <okid/steps/era.h>
#include <okid/steps/observer.h>

#include <math.h>
#include <string.h>

enum {
    P = NODE_P,
    M = NODE_CHANNELS,
    NU = NODE_INPUTS,
    NY = NODE_OUTPUTS,
    NZ = NODE_ORDER,
    LAST = 2 * P, ///< last Markov parameter of a Hankel matrix of P by P blocks and the one a sample later
    WAITING = 16  ///< samples that wait for the kernel: one move of the lag window for so many
};

/// What the observer needs beside its result.
typedef struct observing_t {
    double S[M * M * (P + 1)], head[M * P], tail[M * P], sum[M];
    char work[OKID_STRUCTURED_BYTES(NU, NY, P)];
} observing_t;

typedef struct realizing_t {
    okid_real_t markov[(LAST + 1) * NY * NU], A[NZ * NZ], B[NZ * NU], C[NY * NZ];
    okid_real_t mu_re[NZ / 2], mu_im[NZ / 2], psi_re[NZ * NZ / 2], psi_im[NZ * NZ / 2], emac[NZ / 2];
    okid_real_t frequency[NZ / 2], damping[NZ / 2], mpc[NZ / 2], shape_re[NY * NZ / 2], shape_im[NY * NZ / 2];
    char era[OKID_ERA_BYTES(NU, NY, P, P)], modal[OKID_MODAL_BYTES(NZ)];
} realizing_t;

static union {
    observing_t observing;
    realizing_t realizing;
    uint8_t written[sizeof(realizing_t)];
} work;
static struct {
    okid_accumulator_t* sums;
    uint32_t next; ///< number of the sample that comes next
    int32_t begun;
    okid_real_t theta[NY * (NU + P * M)];
    parts_t parts;
    char block[OKID_ACCUMULATOR_CODES_BYTES(NU, NY, P) + 8 * M * WAITING];
} state;

uint32_t identifier_state_bytes(void) { return sizeof state; }
uint32_t identifier_work_bytes(void) { return sizeof work; }

okid_status_t identifier_reset(void) {
    const okid_accumulator_config_t config = {
        .n_u = NU, .n_y = NY, .lags = P, .sample = OKID_SAMPLE_INT16, .forgetting = 1, .buffer = WAITING};
    state.begun = 0;
    if (NODE_PARTS > 0) parts_reset(&state.parts);
    return okid_accumulator_create(&state.sums, &config, state.block, sizeof state.block);
}

okid_status_t identifier_add(uint32_t first, const int16_t* codes, uint32_t count) {
    const uint32_t ahead = first - state.next; // modulo 2^32: more than half of it lies behind
    if (state.begun && ahead > UINT32_MAX / 2) {
        const uint32_t late = state.next - first;
        if (late >= count) return OKID_OK;
        codes += late * M;
        count -= late;
        first += late;
    } else if (state.begun && ahead > 0)
        okid_accumulator_gap(state.sums, ahead);
    state.begun = 1;
    state.next = first + count;
    const okid_status_t status = okid_accumulator_add_i16(state.sums, codes, count);
    if (NODE_PARTS > 0) parts_look(&state.parts, state.sums);
    return status;
}

static okid_status_t observe(node_modes_t* out) {
    observing_t* w = &work.observing;
    const okid_observer_config_t config = {.n_u = NU, .n_y = NY, .p = P};
    okid_observer_info_t info;
    okid_run_sums_t sums = {.S = w->S, .head = w->head, .tail = w->tail, .sum = w->sum};
    okid_status_t status = okid_accumulator_run(state.sums, OKID_DETREND_MEAN, &sums);
    if (status < 0) return status;
    out->stage = 1;
    status =
        okid_structured_solve(&config, OKID_DETREND_MEAN, &sums, state.theta, NULL, &info, w->work, sizeof w->work);
    out->radius = info.radius;
    out->ridge = info.ridge;
    if (status < 0 || NODE_PARTS == 0) return status;
    status = okid_accumulator_run(state.sums, OKID_DETREND_NONE, &sums); // about 0, as the parts are
    if (status < 0) return status;
    return parts_leave_out(&state.parts, &config, info.ridge, &sums, state.theta, w->work, sizeof w->work);
}

static okid_status_t realize(okid_era_t** era, node_modes_t* out) {
    realizing_t* w = &work.realizing;
    const okid_era_config_t config = {.n_u = NU, .n_y = NY, .rows = P, .cols = P};
    out->stage = 2;
    okid_status_t status = okid_markov_recursion(NU, NY, P, state.theta, LAST, w->markov, NULL);
    if (status < 0) return status;
    out->stage = 3;
    status = okid_era_create(era, &config, w->era, sizeof w->era);
    if (status == OKID_OK) status = okid_era_decompose(*era, w->markov);
    if (status < 0) return status;
    int32_t count = 0;
    const okid_real_t* values = okid_era_singular_values(*era, &count);
    for (int32_t i = 0; i < count && i < NODE_VALUES; ++i) out->singular_values[i] = values[i];
    out->stage = 4;
    return okid_era_realize(*era, NZ, w->A, w->B, w->C, NULL, NULL);
}

static okid_status_t find_modes(double rate_hz, okid_modes_t* modes) {
    realizing_t* w = &work.realizing;
    const okid_model_t model = {.n_u = NU, .n_y = NY, .n_z = NZ, .A = w->A, .C = w->C};
    *modes = (okid_modes_t){0,           0,        w->frequency, w->damping, w->mpc,   w->shape_re,
                            w->shape_im, w->mu_re, w->mu_im,     w->psi_re,  w->psi_im};
    return okid_modal_analyse(&model, 1 / rate_hz, modes, w->modal, sizeof w->modal);
}

static okid_status_t analyse(okid_era_t* era, double rate_hz, node_modes_t* out) {
    realizing_t* w = &work.realizing;
    out->stage = 5;
    okid_modes_t modes;
    okid_status_t status = find_modes(rate_hz, &modes);
    if (status < 0) return status;
    out->count = modes.count;
    status = okid_era_emac(era, NZ, &modes, w->emac);
    for (int32_t k = 0; k < out->count; ++k) {
        out->mode[k].frequency_hz = w->frequency[k];
        out->mode[k].damping_ratio = w->damping[k];
        out->mode[k].mpc = w->mpc[k];
        out->mode[k].emac = w->emac[k];
        for (int32_t o = 0; o < NY; ++o) {
            out->mode[k].shape_re[o] = w->shape_re[k * NY + o];
            out->mode[k].shape_im[o] = w->shape_im[k * NY + o];
        }
    }
    return status;
}

/// Add the squares of what leaving out a part changes: of the mode nearest in frequency, within 10 %, else NaN.
static okid_status_t add_squares(okid_era_t* era, double rate_hz, const okid_real_t* theta, node_modes_t* out) {
    realizing_t* w = &work.realizing;
    okid_modes_t modes = {0};
    okid_status_t status = okid_markov_recursion(NU, NY, P, theta, LAST, w->markov, NULL);
    if (status >= 0) status = okid_era_realize_near(era, NZ, w->markov, w->A, w->C);
    if (status >= 0) status = find_modes(rate_hz, &modes);
    for (int32_t k = 0; status >= 0 && k < out->count; ++k) {
        const double f = out->mode[k].frequency_hz;
        double off = (double)NAN, damping = (double)NAN;
        for (int32_t i = 0; i < modes.count; ++i) {
            const double distance = fabs((double)w->frequency[i] - f);
            if (distance > (isnan(off) ? f / 10 : off)) continue;
            off = distance;
            damping = (double)w->damping[i] - out->mode[k].damping_ratio;
        }
        out->mode[k].frequency_std_hz += off * off;
        out->mode[k].damping_ratio_std += damping * damping;
    }
    return status;
}

static okid_status_t find_deviations(okid_era_t* era, double rate_hz, node_modes_t* out) {
    okid_status_t status = OKID_OK;
    out->stage = 6;
    for (int32_t b = 0; status >= 0 && b < parts_count(&state.parts); ++b)
        status = add_squares(era, rate_hz, parts_theta(&state.parts, b, state.theta), out);
    const double scale = parts_scale(&state.parts);
    for (int32_t k = 0; k < out->count; ++k) {
        out->mode[k].frequency_std_hz = sqrt(scale * out->mode[k].frequency_std_hz);
        out->mode[k].damping_ratio_std = sqrt(scale * out->mode[k].damping_ratio_std);
    }
    return status;
}

void identifier_run(double rate_hz, node_modes_t* out) {
    okid_era_t* era = NULL;
    memset(out, 0, sizeof *out);
    out->status = observe(out);
    if (out->status >= 0) out->status = realize(&era, out);
    if (out->status >= 0) out->status = analyse(era, rate_hz, out);
    if (out->status >= 0 && NODE_PARTS > 0) out->status = find_deviations(era, rate_hz, out);
}

size_t identifier_state(const uint8_t** bytes) {
    const size_t size = okid_accumulator_serialised_size(state.sums);
    *bytes = work.written;
    if (size > sizeof work || okid_accumulator_serialise(state.sums, work.written, sizeof work) != OKID_OK) return 0;
    return size;
}

void identifier_stats(okid_accumulator_stats_t* out) { okid_accumulator_stats(state.sums, out); }
