// SPDX-License-Identifier: MIT
/// @file identifier.h
/// Sums and identification of one structure in static memory: okid's kernels with sizes known at compile time.
/// NODE_P lags (observer order), as many block rows and columns of the Hankel matrix, order twice the degrees of freedom.
/// NODE_PARTS > 0: deviations too, from the scatter among NODE_PARTS / 2 to NODE_PARTS parts of the record and its rest.
#ifndef NODE_IDENTIFIER_H
#define NODE_IDENTIFIER_H

#include <okid/accumulator.h>

#ifndef NODE_INPUTS
#define NODE_INPUTS 1
#define NODE_OUTPUTS 3
#define NODE_DOFS 3
#endif
#ifndef NODE_PARTS
#define NODE_PARTS 0
#endif
enum { NODE_CHANNELS = NODE_INPUTS + NODE_OUTPUTS, NODE_ORDER = 2 * NODE_DOFS, NODE_VALUES = 10 };

/// What identification gave. The numbers are those of the build, float or double, in double.
typedef struct node_modes_t {
    okid_status_t status;
    int32_t stage; ///< of the status: 0 sums, 1 observer, 2 Markov parameters, 3 decomposition, 4 realization, 5 modes,
                   ///< 6 deviations
    int32_t count;
    double radius;                       ///< of the ARX companion
    double ridge;                        ///< that was needed, relative
    double singular_values[NODE_VALUES]; ///< the first of the Hankel matrix
    struct {
        double frequency_hz, damping_ratio, frequency_std_hz, damping_ratio_std; ///< deviations: 0 without NODE_PARTS
        double mpc, emac, shape_re[NODE_OUTPUTS], shape_im[NODE_OUTPUTS];
    } mode[NODE_DOFS];
} node_modes_t;

/// Bytes of the work memory that accumulator and identification stand on.
uint32_t identifier_state_bytes(void);
uint32_t identifier_work_bytes(void);

okid_status_t identifier_reset(void);

/// Samples with numbers first .. first + count - 1: those that did not come are a gap, those that came before are left out.
okid_status_t identifier_add(uint32_t first, const int16_t* codes, uint32_t count);

/// Identify what was summed; the sums stay and go on. @param rate_hz  of the samples
void identifier_run(double rate_hz, node_modes_t* out);

/// The accumulator as bytes in the work memory (until the next call). @return their count, 0 when they do not fit
size_t identifier_state(const uint8_t** bytes);

void identifier_stats(okid_accumulator_stats_t* out);

#endif
