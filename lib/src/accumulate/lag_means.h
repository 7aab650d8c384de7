// SPDX-License-Identifier: MIT
// PURPOSE    means of all lag rows of an accumulator
#ifndef OKID_LAG_MEANS_H
#define OKID_LAG_MEANS_H

#include <okid/accumulator.h>

#ifdef __cplusplus
extern "C" {
#endif

/// @param mean  out, m (lags + 1) means in the order of the Gram matrix, engineering units
/// @return the rows behind them, faded ones by their weight; 0: there are none, mean is not written
double okid_accumulator_lag_means(okid_accumulator_t* self, double* mean);

#ifdef __cplusplus
}
#endif
#endif
