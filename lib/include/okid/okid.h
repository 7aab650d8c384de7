// SPDX-License-Identifier: MIT
/// @file okid.h
/// From measured forces and vibrations to modes, a state-space model, and mass, stiffness and damping: the library on one
/// page, and everything a program needs every day.
///
/// **What it does.** Samples go into an accumulator, which keeps sums of lagged products and forgets the samples. From the
/// sums an identifier makes a model x+ = A x + B u, y = C x + D u with its modes, as often as wanted while samples go on.
///
/// **Six calls.** `samples` holds n samples of 1 force and 3 accelerations, sample by sample, the force first:
///
///     okid_identify_config_t how = okid_identify_defaults(1, 3, 1000.0);   // inputs, outputs, sample rate
///     okid_accumulator_config_t sums = okid_accumulator_defaults(1, 3, okid_identify_lags(&how));
///     void* block = malloc(okid_accumulator_memsize(&sums));               // 1: how much memory
///     okid_accumulator_create(&accumulator, &sums, block, bytes);          // 2: laid out in it
///     okid_accumulator_add(accumulator, samples, n);                       // 3: as often as samples come
///     okid_identify_memsize(&how); okid_identify_create(...);              // 4, 5: the same for the identifier
///     okid_identify_run(identifier, accumulator, &found);                  // 6: found.frequency_hz[0 .. mode_count - 1]
///
/// examples/modes_from_codes.c is the whole program. What may follow: okid/uncertainty.h (standard deviations),
/// okid/mkr.h (mass, stiffness, damping), okid/refine.h (maximum likelihood), okid/stabilization.h (which modes are real),
/// okid/track.h, okid/watch.h and okid/change.h (modes and changes over time), okid/model.h and okid/mechanics.h (simulation). The single steps of an
/// identification, for processors where it does not fit as a whole, stand in okid/steps/.
///
/// **Memory** is the caller's. X_memsize() tells how many bytes a configuration needs (0: it is invalid), X_create() lays
/// the object out in the block, and nothing is ever freed or allocated after that. OKID_X_BYTES() are bounds for static
/// arrays. Sums hold offsets, no pointers: a memcpy of their block is a snapshot. Matrices are column-major.
///
/// **Threads.** One object belongs to one thread at a time; different objects do not know of each other. No locks, no
/// hidden state, no clock, no input or output.
///
/// **Errors.** okid_status_t: 0 is ok, below 0 an error after which nothing has changed, above 0 a valid result with a
/// warning. okid_status_text() gives a line for each. A missing sample is NaN, is counted, and harms nothing after it.
///
/// **NULL** where a pointer is expected is an error and never a fault: a status function gives OKID_ERR_NULL (or the error
/// that it finds first), every other one does nothing and gives 0 or NULL; a struct that such a function fills is then all zeros.
/// Where NULL means something, the function says so. A pointer that is not NULL must point to what it says.
///
/// **Versions.** A program links only with a library of its own interface and number type (okid/abi.h).
#ifndef OKID_H
#define OKID_H
#include <okid/accumulator.h>
#include <okid/change.h>
#include <okid/correlation.h>
#include <okid/identify.h>
#include <okid/mechanics.h>
#include <okid/mkr.h>
#include <okid/modal.h>
#include <okid/model.h>
#include <okid/refine.h>
#include <okid/stabilization.h>
#include <okid/track.h>
#include <okid/types.h>
#include <okid/uncertainty.h>
#include <okid/watch.h>
#endif
