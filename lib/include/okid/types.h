// SPDX-License-Identifier: MIT
/// @file types.h
/// Status codes, export macros and the conventions every okid header follows.
///
/// Matrices are column-major everywhere. Sizes: n_u inputs, n_y outputs, n_x degrees of freedom, n_z states,
/// m = n_u + n_y channels, p lags of the observer (ARX order), q = n_u + p m regressors.
/// A sample v_n = [u_n; y_n] is m numbers, inputs first (paper eq. 23).
/// Memory is the caller's: X_memsize() says how much, X_create() lays an object out in it, nothing is ever freed.
#ifndef OKID_TYPES_H
#define OKID_TYPES_H

#include <stddef.h>
#include <stdint.h>

/// Version of these headers; okid_version() is that of the library.
#define OKID_VERSION_MAJOR 0
#define OKID_VERSION_MINOR 2 ///< as OKID_VERSION_MAJOR
#define OKID_VERSION_PATCH 0 ///< as OKID_VERSION_MAJOR
#define OKID_VERSION "0.2.0" ///< the three together

/// What a program that links with the library may call.
#if defined(_WIN32)
#define OKID_API
#else
#define OKID_API __attribute__((visibility("default")))
#endif
/// The compiler warns when the status is not looked at.
#define OKID_NODISCARD __attribute__((warn_unused_result))

#ifdef __cplusplus
extern "C" {
#endif

/// The number type of results. double, or float where the library is built with -DOKID_REAL=float (a processor with a
/// single-precision unit only); a program that uses such a library defines the same. The rule, in every build:
///   double or integers: sums over samples (accumulator, Gram matrix, means), the normal equations of the observer, and
///                       single numbers in structs and arguments (dt, fs_hz, ridge, condition, radius);
///   okid_real_t:        every array from the observer's result on (theta, innovation, Markov parameters, singular values,
///                       A B C D K, modes, simulated outputs) and the arithmetic between them.
/// Limits near rounding (linalg.hpp: limit_of) follow the type.
#ifndef OKID_REAL
#define OKID_REAL double
#endif
#include <okid/abi.h>
/// The number type of results: OKID_REAL.
typedef OKID_REAL okid_real_t;

/// 0 ok; < 0 error and nothing changed; > 0 warning with a valid result.
typedef enum okid_status_t {
    OKID_OK = 0,
    OKID_WARN_MISSING = 1,    ///< some samples were missing (NaN): counted, the lag window re-arms after them
    OKID_WARN_SATURATED = 2,  ///< some codes stood at full scale: absorbed and counted
    OKID_WARN_MODEL = 3,      ///< a model was identified, with warnings: see okid_identified_t::warnings
    OKID_ERR_NULL = -1,       ///< a required pointer is NULL
    OKID_ERR_DIM = -2,        ///< a size is outside its documented range
    OKID_ERR_MEMORY = -3,     ///< the caller's block is smaller than X_memsize()
    OKID_ERR_MISMATCH = -4,   ///< two objects, or an object and a call, do not fit each other
    OKID_ERR_RANGE = -5,      ///< a sum or count would leave its range
    OKID_ERR_TOO_SHORT = -6,  ///< fewer usable rows than unknowns
    OKID_ERR_INPUT = -7,      ///< an input is constant: it excites nothing
    OKID_ERR_OUTPUT = -8,     ///< an output is constant: it measures nothing
    OKID_ERR_EXCITATION = -9, ///< the inputs together do not excite enough to separate the unknowns
    OKID_ERR_NUMERIC = -10,   ///< a factorisation did not converge
    OKID_ERR_UNSTABLE = -11,  ///< no ridge on the grid gives a stable ARX model
    OKID_ERR_NO_MODES = -12,  ///< the model has no underdamped mode below Nyquist
    OKID_ERR_FORMAT = -13     ///< bytes that are no serialised state: magic, version, length or CRC
} okid_status_t;

/// One line of English for a status; never NULL.
OKID_API const char* okid_status_text(okid_status_t status);

/// Library version, "major.minor.patch".
OKID_API const char* okid_version(void);

/// Which linear algebra stands behind the library: "lapacke" or "eigen".
OKID_API const char* okid_backend(void);

/// What is removed from the record before identification.
typedef enum okid_detrend_t {
    OKID_DETREND_NONE = 0,
    OKID_DETREND_MEAN = 1 ///< each lag row is centred by its own mean (numerics: offsets without a second pass)
} okid_detrend_t;

#ifdef __cplusplus
}
#endif
#endif
