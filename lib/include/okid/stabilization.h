// SPDX-License-Identifier: MIT
/// @file stabilization.h
/// Which poles are stable while the model order and the horizon change: the stabilization diagram, and its columns found
/// by themselves. Models come from okid_identify_poles() (every order from one decomposition), of one or several identifiers
/// (horizons: p or rows). Poles of the structure come back at nearly every order, those of noise do not.
#ifndef OKID_STABILIZATION_H
#define OKID_STABILIZATION_H

#include <okid/identify.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Room, and what counts as stable; a criterion of 0 is its default.
typedef struct okid_stabilization_config_t {
    int32_t n_y;        ///< outputs
    int32_t max_models; ///< models that will be added, >= 1; max_models * max_poles <= 2^20
    int32_t max_poles;  ///< modes of one model, >= 1 (largest order / 2)
    double frequency;   ///< a pole is stable when one of the order before is within this relative distance; 0 = 0.01
    double damping;     ///< and its damping within this relative distance; 0 = 0.05
    double mac;         ///< and the MAC of the shapes is this at least; 0 = 0.98
    double share;       ///< of the models a mode of the structure is found in, at least; 0 = 0.5
} okid_stabilization_config_t;

/// Every criterion at its default.
static inline okid_stabilization_config_t okid_stabilization_defaults(int32_t n_y, int32_t max_models,
                                                                      int32_t max_poles) {
    const okid_stabilization_config_t config = {n_y, max_models, max_poles, 0, 0, 0, 0};
    return config;
}

/// What of a pole agrees with the order before, at the same horizon.
enum {
    OKID_HOLDS_FREQUENCY = 1 << 0, ///< its frequency
    OKID_HOLDS_DAMPING = 1 << 1,   ///< its damping ratio
    OKID_HOLDS_SHAPE = 1 << 2      ///< its shape, by the MAC
};

/// A mode of one of the models.
typedef struct okid_pole_t {
    double frequency_hz;  ///< Hz
    double damping_ratio; ///< 0..1
    double mpc;           ///< modal phase collinearity, 0..1
    double emac;          ///< consistency over the horizon, 0..1
    int32_t horizon;      ///< p (or rows) of its model
    int32_t order;        ///< n_z of its model
    int32_t holds;        ///< OKID_HOLDS_… bits
    int32_t cluster;      ///< index, -1 = none
} okid_pole_t;

/// Poles that belong together, at most one of each model.
typedef struct okid_cluster_t {
    double frequency_hz;  ///< median, Hz
    double damping_ratio; ///< median
    /// 1.4826 median absolute deviations over the models: how well the choice of order is without influence, not an
    /// error of measurement
    double frequency_spread_hz;
    double damping_ratio_spread; ///< the same of the damping ratio
    double mpc;                  ///< median
    int32_t hits;                ///< models it was found in
    int32_t pole;                ///< index of the pole nearest the medians
    int32_t physical;            ///< 1 = hits reach the share
} okid_cluster_t;

/// Looks into the object's block, valid until the next call.
typedef struct okid_stabilized_t {
    int32_t model_count;            ///< models added
    int32_t pole_count;             ///< poles of all of them
    int32_t cluster_count;          ///< clusters found
    const okid_pole_t* poles;       ///< in the order they were added
    const okid_cluster_t* clusters; ///< ascending in frequency; found in a fifth of the models, or more
} okid_stabilized_t;

/// Private; lives in the caller's block.
typedef struct okid_stabilization okid_stabilization_t;

/// Bytes okid_stabilization_create() needs; 0 when the configuration is invalid.
OKID_API size_t okid_stabilization_memsize(const okid_stabilization_config_t* config);
/// Lay a collector out in the caller's block. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY
OKID_NODISCARD OKID_API okid_status_t okid_stabilization_create(okid_stabilization_t** self,
                                                                const okid_stabilization_config_t* config, void* block,
                                                                size_t bytes);

/// Take in the modes of a model. Of one horizon: ascending in order, one after the other.
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_MISMATCH (n_y), OKID_ERR_DIM (more models or modes than configured)
OKID_NODISCARD OKID_API okid_status_t okid_stabilization_add(okid_stabilization_t* self,
                                                             const okid_identified_t* model);

/// Gather the poles taken in so far into clusters: the pole that most models have one near is the first centre (within the
/// frequency criterion and five times the distance 1 - MAC); each model gives the nearest; once more about their median;
/// then the next among what is left. @return OKID_OK, OKID_ERR_NULL
/// Cost O(poles * (poles within the frequency criterion) * n_y).
OKID_NODISCARD OKID_API okid_status_t okid_stabilization_find(okid_stabilization_t* self, okid_stabilized_t* out);

#ifdef __cplusplus
}
#endif
#endif
