// SPDX-License-Identifier: MIT
/// @file uncertainty.h
/// Standard deviations of everything that is printed: frequencies, damping ratios, shapes, M, K, R, alpha, beta, from
/// models of the same record with one block of it left out (delete-one-block jackknife).
///
/// With theta_j the estimate without block j and W_j the share of the information that stood in it,
///   var theta = sum_j (1 - W_j)^2 (theta_j - c)^2 / sum_j W_j (1 - W_j),  c = sum_j (1 - W_j) theta_j / sum_j (1 - W_j),
/// which is (g-1)/g sum (theta_j - mean)^2 for g equal blocks and holds for unequal and for fading blocks too. What is
/// printed is one standard deviation: a 95 % interval is theta +- 1.96 of them. Scatter only: the bias of a finite p is
/// not seen.
#ifndef OKID_UNCERTAINTY_H
#define OKID_UNCERTAINTY_H

#include <okid/identify.h>
#include <okid/mkr.h>
#include <okid/modal.h>
#include <okid/model.h>

#ifdef __cplusplus
extern "C" {
#endif

/// The sums of squared deviations of replicate models from the full one. Private; lives in the caller's block.
typedef struct okid_replicates okid_replicates_t;

/// Sizes, and whether M, K and R are wanted.
typedef struct okid_replicates_config_t {
    int32_t n_u;                  ///< inputs, 0..1048576
    int32_t n_y;                  ///< outputs, 1..1048576
    int32_t n_z;                  ///< largest order of a model that will come, >= 1
    const okid_mkr_config_t* mkr; ///< for M, K, R, alpha, beta; NULL: modes only. Used until finish(), not copied
} okid_replicates_config_t;

/// Modes only.
static inline okid_replicates_config_t okid_replicates_defaults(int32_t n_u, int32_t n_y, int32_t n_z) {
    const okid_replicates_config_t config = {n_u, n_y, n_z, NULL};
    return config;
}

/// What finish() found; the arrays live in the object until the next begin(). NaN where nothing can be said: the mode was
/// missing in replicates that hold more than a quarter of the information, or fewer than three replicates came.
typedef struct okid_uncertainty_t {
    int32_t replicates;                   ///< calls of add()
    int32_t models;                       ///< of these, with a usable model
    int32_t mode_count;                   ///< modes of the full model, in the order of okid_modal_analyse()
    int32_t n_y;                          ///< outputs
    int32_t n_x;                          ///< 0 without M, K, R
    int32_t mkr_used;                     ///< replicates that gave M, K, R
    const int32_t* used;                  ///< mode_count: replicates in which the mode was found
    const okid_real_t* frequency_std_hz;  ///< mode_count
    const okid_real_t* damping_ratio_std; ///< mode_count
    const okid_real_t* shape_re_std;      ///< n_y x mode_count; 0 at the largest entry, which is 1 by scaling
    const okid_real_t* shape_im_std;      ///< n_y x mode_count
    const okid_real_t* M_std;             ///< n_x x n_x, or NULL
    const okid_real_t* K_std;             ///< n_x x n_x, or NULL
    const okid_real_t* R_std;             ///< n_x x n_x, or NULL
    const okid_real_t* R_normal_std;      ///< n_x x n_x, or NULL
    double alpha_std;                     ///< 1/s; NaN without M, K, R
    double beta_std;                      ///< s; NaN without M, K, R
} okid_uncertainty_t;

/// Bytes okid_replicates_create() needs; 0 when the configuration is invalid.
OKID_API size_t okid_replicates_memsize(const okid_replicates_config_t* config);
/// Lay one out in the caller's block. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY
OKID_NODISCARD OKID_API okid_status_t okid_replicates_create(okid_replicates_t** self,
                                                             const okid_replicates_config_t* config, void* block,
                                                             size_t bytes);

/// Restart from the model that everything is compared with: its modes, and its M, K, R where they are wanted.
/// @param full  in, A, C, and for M, K, R also B, D (K is not read); n_u, n_y as configured, 1 <= n_z <= configured
/// @param dt    s
/// @return OKID_OK; OKID_WARN_MODEL: this model has no M, K, R, so they get no deviation;
///         OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_NUMERIC (no modes either: add() will only count)
OKID_NODISCARD OKID_API okid_status_t okid_replicates_begin(okid_replicates_t* self, const okid_model_t* full,
                                                            double dt);

/// Add a model of the record without one block. Its modes are matched to the full model's one to one, nearest poles and
/// most alike shapes first (within 10 % of the frequency, MAC at least 0.5), and its shapes turned and scaled alike.
/// @param replicate  in, any realization of any order <= configured; NULL: there is none (the block was indispensable)
/// @param share      share of the information in the block that was left out, 0 < share < 1; those of all blocks add
///                   up to 1 (1/g for g equal blocks)
/// @return OKID_OK; OKID_WARN_MODEL: a mode, or M, K, R, is missing in this replicate (counted); OKID_ERR_NULL,
///         OKID_ERR_DIM (also a share out of range). Cost of okid_modal_analyse() and okid_mkr_identify()
OKID_NODISCARD OKID_API okid_status_t okid_replicates_add(okid_replicates_t* self, const okid_model_t* replicate,
                                                          double share);

/// The modes of the replicate that was added last, which add() has found, in the order of okid_modal_analyse(); none of NULL.
/// @param out  views into the object, valid until the next add(); eigenvalues and eigenvectors are NULL
/// @return OKID_OK, OKID_ERR_NULL
OKID_NODISCARD OKID_API okid_status_t okid_replicates_last(const okid_replicates_t* self, okid_modes_t* out);

/// Standard deviations of what was added so far; more may be added after it.
/// @return OKID_OK; OKID_WARN_MODEL: some are NaN; OKID_ERR_NULL
OKID_NODISCARD OKID_API okid_status_t okid_replicates_finish(okid_replicates_t* self, okid_uncertainty_t* out);

/// Models without one block each, out of sums alone: from an accumulator of the whole record and one of each part. Private;
/// lives in the caller's block.
typedef struct okid_jackknife okid_jackknife_t;

/// What the models and the sums look like.
typedef struct okid_jackknife_config_t {
    okid_identify_config_t identify; ///< of the full model; its `order` is not read
    okid_accumulator_config_t sums;  ///< of the whole: okid_accumulator_config(). edges = 1, slots = 0
    int32_t linear;     ///< 1: the full model's change to first order in place of a model of the rest, at a fraction of
                        ///< the cost; not with OKID_HANKEL_INNOVATIONS and _LITERAL
    int32_t modes_only; ///< 1: of MOESP, CVA and SSARX A and C are enough: B and D are 0, at a fraction of the cost
} okid_jackknife_config_t;

/// Of an identifier and of the sums it is given.
static inline okid_jackknife_config_t okid_jackknife_defaults(const okid_identify_config_t* identify,
                                                              const okid_accumulator_config_t* sums) {
    const okid_jackknife_config_t config = {*identify, *sums, 0, 0};
    return config;
}

/// Bytes okid_jackknife_create() needs, those of an identifier and of an accumulator; 0 when the configuration is invalid.
OKID_API size_t okid_jackknife_memsize(const okid_jackknife_config_t* config);
/// Lay one out in the caller's block. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY
OKID_NODISCARD OKID_API okid_status_t okid_jackknife_create(okid_jackknife_t** self,
                                                            const okid_jackknife_config_t* config, void* block,
                                                            size_t bytes);

/// @param whole  the whole record; it must stay as it is until the last okid_jackknife_delete()
/// @param full   its model, of which the order and the ridge are kept: every replicate has them
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM (order), OKID_ERR_MISMATCH, OKID_ERR_TOO_SHORT
OKID_NODISCARD OKID_API okid_status_t okid_jackknife_begin(okid_jackknife_t* self, okid_accumulator_t* whole,
                                                           const okid_identified_t* full);

/// The same for `linear` (Doehler, Mevel 2013): the model is differentiated by the sums, once, out of what an identifier
/// holds since it found it.
/// @param by  the identifier whose last run, on the sums of the whole, gave `full`; it must stay as it is until the last
///            okid_jackknife_delete()
/// @return as okid_jackknife_begin(); OKID_ERR_MISMATCH also: created without `linear`, or `by` was given a triangular
///         factor and not sums; OKID_ERR_NUMERIC: the model has no derivative
OKID_NODISCARD OKID_API okid_status_t okid_jackknife_begin_linear(okid_jackknife_t* self, okid_identify_t* by,
                                                                  okid_accumulator_t* whole,
                                                                  const okid_identified_t* full);

/// The model of the whole without one part. With `linear` poles and shapes to first order, in modal coordinates (as it comes,
/// A + dA, where A has no independent eigenvectors); of MOESP and CVA B and D belong to the full model.
/// @param part    in, the sums of the part; see okid_accumulator_remove(), also for `weight`. NULL, not with `linear`: nothing
///                is left out, for sums of another horizon than the full model's: at its order and ridge
/// @param model   out, valid until the next call (K is NULL)
/// @param share   out, share of the information in the part: of the energy of the channels, each counting alike, so
///                that a part with a hammer hit weighs more than one of ringing down
/// @return OKID_OK; OKID_ERR_NULL, OKID_ERR_MISMATCH; the errors of okid_identify_run(): without this part there is no
///         model (then `share` is valid, for okid_replicates_add(NULL))
OKID_NODISCARD OKID_API okid_status_t okid_jackknife_delete(okid_jackknife_t* self, okid_accumulator_t* part,
                                                            double weight, okid_model_t* model, double* share);

#ifdef __cplusplus
}
#endif
#endif
