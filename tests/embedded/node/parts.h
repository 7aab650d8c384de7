// SPDX-License-Identifier: MIT
/// @file parts.h
/// The record in parts, NODE_PARTS / 2 to NODE_PARTS of equal length and the rest: what leaving one out does to the
/// observer. One standard deviation of anything that follows is sqrt(parts_scale() times the sum of its squared changes).
/// NODE_PARTS 0: nothing is kept, and none of the functions is there.
#ifndef NODE_PARTS_H
#define NODE_PARTS_H

#include "identifier.h"

#include <okid/steps/observer.h>

enum { PARTS_Q = NODE_INPUTS + NODE_P * NODE_CHANNELS, PARTS_MOST = NODE_PARTS > 0 ? NODE_PARTS + 1 : 1 };

/// Sums about 0 up to the end of a part: exact, as the codes are integers.
typedef struct part_t {
    double S[NODE_CHANNELS * NODE_CHANNELS * (NODE_P + 1)], tail[NODE_CHANNELS * NODE_P], sum[NODE_CHANNELS];
    int64_t rows;
} part_t;

typedef struct parts_t {
#if NODE_PARTS
    int32_t ended;
    int64_t length; ///< rows of a part
    part_t at[PARTS_MOST];
    okid_real_t change[PARTS_MOST][NODE_OUTPUTS * PARTS_Q]; ///< of theta, without a part
#else
    char none;
#endif
} parts_t;

void parts_reset(parts_t* self);

/// Does a part end here? To be called after samples were added.
void parts_look(parts_t* self, okid_accumulator_t* sums);

/// What leaving out each part, and the rest, does to theta. @param whole  sums about 0 @param work  of the observer, free again
okid_status_t parts_leave_out(parts_t* self, const okid_observer_config_t* config, double ridge,
                              const okid_run_sums_t* whole, const okid_real_t* theta, void* work, size_t bytes);

/// With the rest.
int32_t parts_count(const parts_t* self);
/// theta without part b; once, after parts_leave_out().
const okid_real_t* parts_theta(parts_t* self, int32_t b, const okid_real_t* theta);
/// 1 / (1 - sum of the squared shares of the rows).
double parts_scale(const parts_t* self);

#endif
