// SPDX-License-Identifier: MIT
/// @file track.h
/// Modes followed from update to update: which mode of this model is which mode of the one before. A track has a number
/// that is never given to another; a mode that is absent for a while keeps it, and so does one that jumps (a structure that
/// was changed), as far as its shape is known again. Where a model holds samples from before and after the jump, the mode
/// stands at both places for a while; the new one takes the number when the old one was missed `dies`/10 times.
#ifndef OKID_TRACK_H
#define OKID_TRACK_H

#include <okid/types.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Room, and what belongs together; 0 is the default of a criterion.
typedef struct okid_track_config_t {
    int32_t n_y;        ///< outputs, entries of a shape
    int32_t max_modes;  ///< of one update, >= 1
    int32_t max_tracks; ///< followed at a time, >= 1; further modes wait until one ends. Both <= 4096
    int32_t born;       ///< consecutive updates that make a track; 0 = 3
    int32_t dies;       ///< consecutive updates without it that end it; 0 = 100
    double frequency;   ///< a mode belongs to a track within this relative distance; 0 = 0.05
    double jump;        ///< and to one that was lost within this one; 0 = 0.3
    double mac;         ///< MAC of the shapes, at least; 0 = 0.5. Midway to 1 for a jump
    double
        close_hz; ///< modes nearer than this to each other are mixtures, known by the shapes they had before; 0 = none
} okid_track_config_t;

/// As many tracks as modes, every criterion at its default.
static inline okid_track_config_t okid_track_defaults(int32_t n_y, int32_t max_modes) {
    const okid_track_config_t config = {n_y, max_modes, max_modes, 0, 0, 0, 0, 0, 0};
    return config;
}

/// What is known of a track.
typedef struct okid_track_t {
    int32_t number;       ///< from 1 in the order of birth; 0 = a candidate
    int32_t hits;         ///< updates it was seen in
    int32_t misses;       ///< updates since, 0 = in the newest one
    double frequency_hz;  ///< when last seen, Hz
    double damping_ratio; ///< when last seen
} okid_track_t;

/// Private; lives in the caller's block.
typedef struct okid_tracks okid_tracks_t;

/// Bytes okid_track_create() needs; 0 when the configuration is invalid.
OKID_API size_t okid_track_memsize(const okid_track_config_t* config);
/// Lay an object without tracks out in the caller's block. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY
OKID_NODISCARD OKID_API okid_status_t okid_track_create(okid_tracks_t** self, const okid_track_config_t* config,
                                                        void* block, size_t bytes);

/// Take in the modes of an update. Modes and tracks are paired so that the sum of their distances is least (optimal
/// assignment: no two modes on one track), distance = (df/(frequency f))^2 + ((1 - MAC)/(1 - mac))^2, below 1 for a pair. Of the
/// second term 0.65 are for the shape last seen, 0.35 for the mean of some ten; all of it for the mean of modes that are nearer to
/// another than close_hz, or were when last seen: there estimated shapes are mixtures, and the mean waits. Close
/// modes that swap order keep their identity by the shape; with one output the shape says nothing and the order remains.
/// A mode without a track is a candidate; seen `born` times in a row it takes over the track nearest to it that was lost
/// when it appeared (`jump`), else it gets the next number. Do not call it for an update without a model: that is no miss.
/// @param count  modes, >= 0; frequency_hz, damping_ratio  count each; shape_re, shape_im  n_y x count
/// @param number out, count: the track of each mode, 0 = none yet
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM (count above max_modes; a frequency that is not positive)
/// Cost O(n^2 (n_y + n)), n the larger of modes and tracks.
OKID_NODISCARD OKID_API okid_status_t okid_track_update(okid_tracks_t* self, int32_t count,
                                                        const okid_real_t* frequency_hz,
                                                        const okid_real_t* damping_ratio, const okid_real_t* shape_re,
                                                        const okid_real_t* shape_im, int32_t* number);

/// The structure has changed (okid/watch.h): the next update may find every track at any distance up to `jump`. Candidates
/// are forgotten: they come of old and new samples mixed.
OKID_API void okid_track_jump(okid_tracks_t* self);

/// How many tracks and candidates there are now.
OKID_API int32_t okid_track_count(const okid_tracks_t* self);
/// The k-th of them, in no particular order. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM (there is none)
OKID_API okid_status_t okid_track_get(const okid_tracks_t* self, int32_t k, okid_track_t* out);

#ifdef __cplusplus
}
#endif
#endif
