// SPDX-License-Identifier: MIT
/// @file identify.h
/// One call from an accumulator to a model with its modes. The same call serves a file, a stream and a microcontroller.
#ifndef OKID_IDENTIFY_H
#define OKID_IDENTIFY_H

#include <okid/accumulator.h>
#include <okid/types.h>

#ifdef __cplusplus
extern "C" {
#endif

/// How a model is found.
typedef enum okid_method_t {
    OKID_METHOD_OKID_ERA = 0,    ///< observer least squares, Markov recursion, ERA. Without inputs: ERA on the
                                 ///< covariances of the outputs, which stand in place of the Markov parameters
    OKID_METHOD_OKID_ERA_DC = 1, ///< the same Markov parameters, ERA with data correlations (xi = zeta = 2, tau = 1)
    OKID_METHOD_N4SID_MOESP = 2, ///< subspace methods, okid/steps/subspace.h; with and without inputs
    OKID_METHOD_N4SID_CVA = 3,   ///< canonical weighting
    OKID_METHOD_N4SID_SSARX = 4  ///< the future corrected by an ARX model
} okid_method_t;

/// What a block of the Hankel matrix of okid-era and okid-era-dc holds (records with inputs). In all three the gain K
/// follows by least squares through the observability matrix.
typedef enum okid_hankel_t {
    OKID_HANKEL_SYSTEM = 0,      ///< Y_k
    OKID_HANKEL_INNOVATIONS = 1, ///< [Y_k Su^(1/2), Y0_k Se^(1/2)], Su covariance of the inputs, Se of the innovations
    OKID_HANKEL_LITERAL = 2      ///< [Y_k Y0_k], eq. 42 as printed: depends on units and takes in noise modes (trap 1)
} okid_hankel_t;

/// How the observer's least squares are solved from an accumulator.
typedef enum okid_solver_t {
    OKID_SOLVER_DENSE = 0,     ///< from the Gram matrix, (m(p+1))^2 doubles: fastest, any accumulator
    OKID_SOLVER_STRUCTURED = 1 ///< from the sums themselves, O(m q) memory: one unbroken run (okid/steps/observer.h)
} okid_solver_t;

/// Remarks on a valid result, as bits of okid_identified_t::warnings; okid_warning_code() and _text() name them.
enum {
    OKID_NOTE_ARX_STABILISED =
        1 << 0, ///< plain least squares was unstable; a ridge made it stable (ridge, radius_plain)
    OKID_NOTE_ILL_CONDITIONED = 1 << 1,    ///< condition above 1e10: near noise-free or redundant channels
    OKID_NOTE_FEW_ROWS = 1 << 2,           ///< fewer than 10 q regression rows: variances are large
    OKID_NOTE_MODEL_UNSTABLE = 1 << 3,     ///< the realised A has a pole on or outside the unit circle
    OKID_NOTE_PREDICTOR_UNSTABLE = 1 << 4, ///< A - K C is unstable: no prediction from this gain
    OKID_NOTE_ORDER_REDUCED = 1 << 5,      ///< the order asked for exceeds what the Hankel matrix can carry
    OKID_NOTE_ORDER_UNCLEAR =
        1 << 6, ///< no clear gap in the singular values: smallest order that keeps the consistent modes
    OKID_NOTE_WEAK_EXCITATION = 1 << 7, ///< the inputs excite some directions only weakly
    OKID_NOTE_LITERAL_HANKEL = 1 << 8   ///< OKID_HANKEL_LITERAL was asked for: damping depends on the units
};
/// Name of a single bit as in okid.result/1 ("arx_stabilised", ...), NULL for an unknown one.
OKID_API const char* okid_warning_code(uint32_t bit);

/// What is to be identified, and how; zeros are defaults.
typedef struct okid_identify_config_t {
    int32_t n_u;   ///< inputs, >= 0; 0 (ambient): modes and predictor only
    int32_t n_y;   ///< outputs, >= 1; n_u + n_y <= 256
    int32_t p;     ///< observer (ARX) order, 1..4096; n4sid: not used; okid without inputs: only the default of rows
    int32_t rows;  ///< block rows (okid: and columns) of the Hankel matrices, at most 8192; 0 = 2 p, n4sid 30, okid
                   ///< without inputs p
    int32_t order; ///< n_z; 0 = automatic
    int32_t max_order; ///< bound of the automatic order and of the memory; 0 = min(128, what the Hankel matrix carries)
    double fs_hz;      ///< sample rate
    okid_method_t method;   ///< 0 = okid-era
    okid_detrend_t detrend; ///< 0 = none
    okid_solver_t solver;   ///< n4sid, and okid without inputs: dense
    okid_hankel_t hankel;   ///< n4sid, and okid without inputs: system
} okid_identify_config_t;

/// okid-era with p = 40, automatic order, means removed.
static inline okid_identify_config_t okid_identify_defaults(int32_t n_u, int32_t n_y, double fs_hz) {
    const okid_identify_config_t config = {
        n_u, n_y, 40, 0, 0, 0, fs_hz, OKID_METHOD_OKID_ERA, OKID_DETREND_MEAN, OKID_SOLVER_DENSE, OKID_HANKEL_SYSTEM};
    return config;
}

/// What the least squares of an observer found, beside the parameters.
typedef struct okid_observer_info_t {
    double ridge;  ///< ridge used, relative to the unit-diagonal Gram
    double radius; ///< spectral radius of the ARX companion matrix with that ridge; beyond 64 states its growth over 64
                   ///< samples where that is above 1.0005: a response that first grows marks a poor model too
    double radius_plain;     ///< the same with ridge_min: >= 1 means the plain least squares is unstable (trap 22)
    double condition;        ///< estimate (1-norm) of the condition of the equilibrated, ridged Gram
    double input_excitation; ///< smallest over largest pivot of the equilibrated Gram of the input lags; near 0 = poor
    int32_t channel;         ///< the channel an error speaks of, else -1
} okid_observer_info_t;

/// An identified model. Every pointer looks into the identifier's block and stays valid until the next run. Of an n4sid
/// method, and of an okid method without inputs, p is rows (the past it looks back on), `observer` is NULL,
/// observer_info.radius and radius_plain are 0.
typedef struct okid_identified_t {
    uint32_t warnings;       ///< OKID_NOTE_… bits
    int32_t n_u;             ///< inputs
    int32_t n_y;             ///< outputs
    int32_t n_z;             ///< states
    int32_t p;               ///< lags
    int32_t rows;            ///< block rows of the Hankel matrix
    int32_t singular_count;  ///< numbers in singular_values
    int32_t markov_count;    ///< blocks in markov
    int32_t mode_count;      ///< modes in the arrays below
    int64_t regression_rows; ///< rows behind the least squares
    double dt;               ///< s
    const okid_real_t* A;    ///< n_z x n_z, column-major as the next four
    const okid_real_t* B;    ///< n_z x n_u
    const okid_real_t* C;    ///< n_y x n_z
    const okid_real_t* D;    ///< n_y x n_u
    const okid_real_t* K;    ///< n_z x n_y, Kalman gain
    /// Descending. okid-era: of H(0) (without inputs: of covariances of outputs scaled to unit variance); okid-era-dc: of
    /// the matrix of correlations; n4sid: okid_subspace_singular_values()
    const okid_real_t* singular_values;
    /// Y_0 .. Y_(markov_count-1), n_y x n_u blocks, at least 2 rows + 1 (none when n_u = 0). okid: by eq. (40) from the
    /// observer, n4sid: of the model
    const okid_real_t* markov;
    const okid_real_t* observer;      ///< theta, n_y x q, or NULL
    const okid_real_t* innovation;    ///< n_y x n_y
    const double* mean;               ///< m channel means that were removed (zeros for detrend none)
    const okid_real_t* frequency_hz;  ///< mode_count
    const okid_real_t* damping_ratio; ///< mode_count
    const okid_real_t* mpc;           ///< mode_count; modal phase collinearity, 0..1
    const okid_real_t* emac;          ///< mode_count; consistency over the horizon, 0..1
    const okid_real_t* cmi;      ///< mode_count; consistent-mode indicator EMAC x MPC (Pappa, Elliott, Schenk 1993)
    const okid_real_t* shape_re; ///< n_y x mode_count, the largest entry of each is 1
    const okid_real_t* shape_im; ///< n_y x mode_count
    double model_radius;         ///< spectral radius of A
    /// Singular values up to this can come from the errors of the observer alone (okid-era with inputs and automatic order,
    /// Hankel matrix of the system, dense solver; else NaN). One above it need not be a mode: drift, hum and a finite p
    /// leave more than least squares knows of
    double noise_level;
    okid_observer_info_t observer_info; ///< what the least squares found
} okid_identified_t;

/// Holds workspace and result. Private; lives in the caller's block.
typedef struct okid_identify okid_identify_t;

/// p as asked for, or the largest p with 10 q <= samples when that is smaller (at least 1).
OKID_API int32_t okid_identify_usable_p(int32_t n_u, int32_t n_y, int32_t p, int64_t samples);

/// Lags an accumulator must have for this configuration: p, 2 rows - 1 for the n4sid methods, 2 rows for okid-era without
/// inputs (okid-era-dc: 4 more); 0 when it is invalid.
OKID_API int32_t okid_identify_lags(const okid_identify_config_t* config);

/// Bytes okid_identify_create() needs; 0 when the configuration is invalid.
OKID_API size_t okid_identify_memsize(const okid_identify_config_t* config);
/// Lay an identifier out in the caller's block. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY
OKID_NODISCARD OKID_API okid_status_t okid_identify_create(okid_identify_t** self, const okid_identify_config_t* config,
                                                           void* block, size_t bytes);

/// Identify from what the accumulator holds now. No heap. What the accumulator holds is not changed.
/// @param out  filled also on error as far as the work went (observer_info.channel names the channel at fault)
/// @return OKID_OK, OKID_WARN_MODEL, or the errors of okid_observer_solve() (n4sid: okid_subspace_decompose()),
///         OKID_ERR_MISMATCH (sizes; with the structured solver also more than one run) and OKID_ERR_NO_MODES
OKID_NODISCARD OKID_API okid_status_t okid_identify_run(okid_identify_t* self, okid_accumulator_t* accumulator,
                                                        okid_identified_t* out);

/// The part of okid_identify_run() that all orders have in common, for okid_identify_poles(): no order is chosen, no model made.
/// Of okid-era with a large Hankel matrix the singular values of `out` end at max_order, zeros follow.
/// @return as okid_identify_run(), without OKID_WARN_MODEL and OKID_ERR_NO_MODES
OKID_NODISCARD OKID_API okid_status_t okid_identify_decompose(okid_identify_t* self, okid_accumulator_t* accumulator,
                                                              okid_identified_t* out);

/// After okid_identify_decompose() with n4sid-cva the same sums with n4sid-moesp, from the factor that stands: both project alike and
/// weight otherwise. The identifier has this method from then on, and may go back.
/// @param order  models will have, at most; one of a larger order decomposes again
/// @param out    that of okid_identify_decompose(): its singular values become those of this method
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_NUMERIC; OKID_ERR_MISMATCH: another method, nothing decomposed, order < 1
OKID_NODISCARD OKID_API okid_status_t okid_identify_decompose_as(okid_identify_t* self, okid_method_t method,
                                                                 int32_t order, okid_identified_t* out);

/// Largest order that can be asked for.
OKID_API int32_t okid_identify_max_order(const okid_identify_config_t* config);

/// Realize another order from the same decomposition (stabilization diagrams): replaces A..K and the modes in `out`; of
/// an n4sid method also the innovation and the Markov parameters.
OKID_NODISCARD OKID_API okid_status_t okid_identify_order(okid_identify_t* self, int32_t order, okid_identified_t* out);

/// The modes of another order only: A, C and the modes in `out` are replaced, B, D, K are not (many times cheaper). EMAC is
/// that of the horizon until a mode has fallen to exp(-4) of its amplitude (SSARX: of all of it). For okid_stabilization_add();
/// okid_identify_order() makes `out` whole again.
OKID_NODISCARD OKID_API okid_status_t okid_identify_poles(okid_identify_t* self, int32_t order, okid_identified_t* out);

/// Put other B and D into the n4sid model of the last run, where the record itself could be fitted
/// (okid_subspace_output_error()); the Markov parameters follow.
/// @param B, D  in, n_z x n_u and n_y x n_u @return OKID_OK, OKID_ERR_NULL, OKID_ERR_MISMATCH (not of an n4sid method)
OKID_NODISCARD OKID_API okid_status_t okid_identify_set_inputs(okid_identify_t* self, const okid_real_t* B,
                                                               const okid_real_t* D, okid_identified_t* out);

#ifdef __cplusplus
}
#endif
#endif
