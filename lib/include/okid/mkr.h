// SPDX-License-Identifier: MIT
/// @file mkr.h
/// Mass, damping and stiffness from an identified discrete state-space model (paper eq. 96-123), with the checks that tell
/// whether they can be believed.
///
/// Every degree of freedom needs a sensor or an actuator, and at least one needs both (a co-located pair).
#ifndef OKID_MKR_H
#define OKID_MKR_H

#include <okid/mechanics.h>
#include <okid/types.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Where the channels stand, and what they show.
typedef struct okid_mkr_config_t {
    int32_t n_x;                    ///< degrees of freedom = modes to use, >= 1
    int32_t hold;                   ///< okid_hold_t: what the forces do between samples; the wrong one ruins M, K and R
    double dt;                      ///< sample time, s
    const int32_t* input_dof;       ///< n_u: 0-based degree of freedom each force acts on; -1 = on none of these
    const okid_real_t* input_gain;  ///< n_u: force for one unit recorded (-1: reversed), not 0; or NULL (all 1)
    const int32_t* output_dof;      ///< n_y: 0-based degree of freedom of each sensor; -1 = on none of these
    const okid_real_t* output_gain; ///< n_y: what one unit of motion shows as in the record, not 0; or NULL (all 1)
    const int32_t* output_sensing;  ///< n_y: okid_sensing_t of each sensor, mixed as they come
} okid_mkr_config_t;

/// Forces held between samples, all gains 1. input_dof, output_dof and output_sensing are still to be given.
static inline okid_mkr_config_t okid_mkr_defaults(int32_t n_x, double dt) {
    const okid_mkr_config_t config = {n_x, OKID_HOLD_ZERO, dt, NULL, NULL, NULL, NULL, NULL};
    return config;
}

/// Remarks on a result; okid_mkr_note() gives their names.
enum {
    OKID_MKR_POLARITY = 1 << 0,  ///< -M is positive definite: a swapped polarity, or sensing kinds off by two
    OKID_MKR_MASS = 1 << 1,      ///< neither M nor -M is positive definite
    OKID_MKR_STIFFNESS = 1 << 2, ///< K is not positive definite
    OKID_MKR_DAMPING = 1 << 3,  ///< R is not positive definite (the hardest of the three: see R_normal, okid_pdc_fit())
    OKID_MKR_RESIDUAL = 1 << 4, ///< residual > 0.03: residues out of phase (kinds off by one, channels late, noise)
    OKID_MKR_FEEDTHROUGH = 1 << 5, ///< feedthrough > 0.1: D does not fit M (delay, missing modes, wrong kind of sensor)
    OKID_MKR_COMPLEX = 1 << 6,     ///< a mode with mpc < 0.9: its points do not move in phase
    OKID_MKR_SPREAD = 1 << 7,      ///< a mode with pair_spread > 0.1: the co-located pairs contradict each other
    OKID_MKR_CLOSE = 1 << 8        ///< margin < 2: the choice of modes was close
};

/// The result; the arrays live in the work block. Modes ascend in frequency.
typedef struct okid_mkr_t {
    uint32_t notes;              ///< OKID_MKR_...
    int32_t n_x;                 ///< as configured
    int32_t admissible;          ///< pairs 0 < zeta < 1 below Nyquist there were to choose from
    int32_t pairs;               ///< co-located pairs
    int32_t dof;                 ///< OKID_ERR_MISMATCH: the degree of freedom with neither sensor nor actuator, or -1
    int32_t feedthrough_row;     ///< the output where `feedthrough` stands, or -1
    const okid_real_t* M;        ///< n_x x n_x, symmetric
    const okid_real_t* K;        ///< n_x x n_x, symmetric
    const okid_real_t* R;        ///< n_x x n_x, symmetric
    const okid_real_t* R_normal; ///< n_x x n_x, from M, the real parts of the shapes, and f, zeta
    const okid_real_t* frequency_hz;  ///< n_x
    const okid_real_t* damping_ratio; ///< n_x
    const okid_real_t* lambda_re;     ///< n_x, 1/s
    const okid_real_t* lambda_im;     ///< n_x, > 0
    const okid_real_t* W_re;          ///< n_x x n_x: column k is the shape of mode k scaled as eq. (105), re
    const okid_real_t* W_im;          ///< and im
    const int32_t* mode;              ///< n_x: place of the mode in the list of okid_modal_analyse() of the same model
    const okid_real_t* strength;      ///< n_x: share of a mode in the variance under white forces, 0..1
    const okid_real_t* mpc;           ///< n_x: modal phase collinearity of W(:, k), 0..1, rows of W scaled to one size
    const okid_real_t* phase;       ///< n_x: angle of W(:, k) sqrt(2 i w_d) from the real axis, rad; outputs that come
                                    ///< tau late show as -w_d tau/2 in every mode
    const okid_real_t* pair_spread; ///< n_x: |b - t^2 c lambda^-b| / |b| over the co-located pairs; 0 for a single pair
    okid_real_t margin;      ///< strength of the weakest mode taken over the strongest one left; 0: none was left
    okid_real_t residual;    ///< |2 Re W W^T| / 2 sum |w|^2 (eq. 115), rows of W scaled to one size. With normal
                             ///< modes each is zero by itself: it sees phases; a missing mode shows in `feedthrough`
    okid_real_t feedthrough; ///< largest misfit of a row of D to C_a M^-1 B_a, relative to the modes' sum there
    okid_real_t gain;        ///< D over M^-1 at the co-located accelerometers, 1 when all is well; 0: there are none
    okid_real_t condition;   ///< of the model's eigenvectors: about this many eps are lost
} okid_mkr_t;

/// Bytes of work. 0 if a size is < 1.
OKID_API size_t okid_mkr_memsize(int32_t n_u, int32_t n_y, int32_t n_z, int32_t n_x);

/// M, K and R of the mechanical system behind a discrete model (eq. 116, 120-123, corrected: docs/numerics.md traps 10-14,
/// 16, 18, 19, 21).
///   modes   of the pairs with 0 < zeta < 1 below Nyquist the n_x strongest; one mode's strength is its share of
///           |c b|^2 / (2 |Re lambda|), averaged over the input-output channels: free of units and gains
///   scale   t_k^2 by least squares over all co-located pairs of b_k = t_k^2 c_k lambda_k^-b, one t_k for sensors and forces
///   shapes  w_k = t_k c_k lambda_k^-b (mean over the sensors of a degree of freedom), or b_k / t_k where there is no sensor
///   M = [2 Re W L W^T]^-1,  K = -[2 Re W L^-1 W^T]^-1,  R = -M 2 Re(W L^2 W^T) M;  transpose, never conjugate
///   R_normal = M F diag(2 zeta w) F^T M, F = Re(W sqrt(2 i w_d)), each turned by its `phase` and scaled to f^T M f = 1
/// Not to be seen from inside: a common gain error (u read g times and y read h times too large scale M, K and R by g/h);
/// a sensor whose kind is wrong by two, away from every force that it feels at once; a mode above Nyquist; modes closer
/// than the noise, unless several pairs contradict each other.
/// 30 n_z^3 flop. Relative errors from an exact model: double 1e-13, R 2e-12; float 1e-4, R 2e-3.
/// @param model   in, A, B, C, D of n_z states (K is not read), any realization
/// @param result  out; on an error `admissible`, `pairs` and `dof` say why, the rest is zero
/// @param work    okid_mkr_memsize() bytes; the arrays of the result live there
/// @return OKID_OK; OKID_WARN_MODEL: valid, with notes; OKID_ERR_NULL, OKID_ERR_DIM (a size, dt, dof, kind or gain out of
///         range), OKID_ERR_MEMORY; OKID_ERR_MISMATCH: a degree of freedom has neither sensor nor actuator (`dof`), or
///         there is no co-located pair (`dof` = -1); OKID_ERR_NO_MODES: fewer than n_x admissible modes;
///         OKID_ERR_NUMERIC: the eigenvectors do not span the state space, or the modes cannot be scaled or inverted
OKID_NODISCARD OKID_API okid_status_t okid_mkr_identify(const okid_model_t* model, const okid_mkr_config_t* config,
                                                        okid_mkr_t* result, void* work, size_t bytes);

/// Short name of one OKID_MKR_... bit ("mass_indefinite"); NULL for an unknown one.
OKID_API const char* okid_mkr_note(uint32_t bit);

// ---- proportional damping coefficients: R = alpha M + beta K from frequencies and damping ratios (eq. 124-131)

/// R = alpha M + beta K, and how well that fits.
typedef struct okid_pdc_t {
    okid_real_t alpha; ///< 1/s, of M
    okid_real_t beta;  ///< s, of K
    okid_real_t
        residual; ///< |zeta - fit| / |zeta| (weighted Euclidean norms): how far the damping is from proportional
    okid_real_t condition; ///< of the two columns after scaling; above 1e3 alpha and beta cannot be told apart
} okid_pdc_t;

/// Least squares of zeta_k = alpha/(2 w_k) + beta w_k/2 over the modes (eq. 125-130). O(count) flop.
/// One mode, or modes of one frequency, fix only the sum: then the solution of least scaled norm is returned, which
/// splits the damping evenly; R is right all the same for those modes.
/// @param count          modes, >= 1
/// @param frequency_hz   in, count, > 0; @param damping_ratio  in, count
/// @param weight         in, count, >= 0 and not all 0 (1/variance of the damping ratio), or NULL (all 1)
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM (also for a frequency that is not positive, a weight that is negative
///         or a value that is not finite)
OKID_NODISCARD OKID_API okid_status_t okid_pdc_fit(int32_t count, const okid_real_t* frequency_hz,
                                                   const okid_real_t* damping_ratio, const okid_real_t* weight,
                                                   okid_pdc_t* pdc);

/// R = alpha M + beta K (eq. 131). @param M, K  in, n_x x n_x; @param R  out, n_x x n_x
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM
OKID_NODISCARD OKID_API okid_status_t okid_pdc_damping(int32_t n_x, const okid_pdc_t* pdc, const okid_real_t* M,
                                                       const okid_real_t* K, okid_real_t* R);

#ifdef __cplusplus
}
#endif
#endif
