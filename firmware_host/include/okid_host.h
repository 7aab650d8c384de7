/* SPDX-License-Identifier: MIT */
/**
 * @file okid_host.h
 * @brief Everything between the kernels (okid/okid.h) and a user, for every language: the face of libokid_host.
 *
 * What it does: measured records to a result (okid_host/record.h), samples as they arrive to results
 * (okid_host/stream.h), two results to the shifts between them (okid_host/compare.h), sensors that are missing
 * (okid_host/virtual.h), frames and bytes of devices to samples and events (okid_host/capture.h), configurations, CSV files
 * and signal descriptions read (okid_host/files.h). The program `okid` and the Python package stand on the same code.
 *
 * Calls return 0, or the exit code the program would end with: 2 wrong usage or bad input, 3 no reliable model,
 * 4 device, memory or disk. okid_host_error() then gives the sentence the program would print. Nothing is changed by a call
 * that fails, unless its description says so. No exception leaves the library.
 *
 * NULL where a pointer is expected is an error and never a fault: 2, or NULL or 0 from what gives no such code. Arrays of no
 * elements may be NULL.
 *
 * Objects are opaque handles: made by ..._create() or handed out by a call, ended by ..._delete(), which takes NULL too.
 * Memory: the library's own (malloc); arrays that go in are read during the call only; pointers that come out belong to the
 * object they were asked of and stay valid until that object is changed or deleted.
 * Threads: different objects may be used by different threads at once, one object by one thread at a time.
 * Samples travel as rows [u; y]: inputs, then outputs, sample by sample, NaN = missing.
 */
#ifndef OKID_HOST_H
#define OKID_HOST_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__GNUC__)
#define OKID_HOST_API __attribute__((visibility("default")))
#else
#define OKID_HOST_API
#endif

/** Number of this interface: a caller compiled against another one must not go on. */
#define OKID_HOST_ABI 1

/** OKID_HOST_ABI the library was built with. */
OKID_HOST_API int32_t okid_host_abi(void);

/** What the last failed call of this thread has to say: one or more lines of UTF-8, "" before the first failure. */
OKID_HOST_API const char* okid_host_error(void);

/// okid_status_t behind that failure where the kernels found it (okid/types.h), else 0.
OKID_HOST_API int32_t okid_host_error_status(void);

#ifdef __cplusplus
}
#endif

#include <okid_host/capture.h>
#include <okid_host/compare.h>
#include <okid_host/files.h>
#include <okid_host/record.h>
#include <okid_host/responses.h>
#include <okid_host/stream.h>
#include <okid_host/virtual.h>

#endif
