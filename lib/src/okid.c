// SPDX-License-Identifier: MIT
// PURPOSE    version and status texts
#include <okid/types.h>

const char* okid_version(void) { return OKID_VERSION; }

const char* okid_status_text(okid_status_t status) {
    switch (status) {
    case OKID_OK: return "ok";
    case OKID_WARN_MISSING: return "some samples were missing";
    case OKID_WARN_SATURATED: return "some codes stood at full scale";
    case OKID_WARN_MODEL: return "a model was identified, with warnings";
    case OKID_ERR_NULL: return "a required pointer is NULL";
    case OKID_ERR_DIM: return "a size is outside its range";
    case OKID_ERR_MEMORY: return "the memory block is too small";
    case OKID_ERR_MISMATCH: return "the objects do not fit each other";
    case OKID_ERR_RANGE: return "a sum or a count would leave its range";
    case OKID_ERR_TOO_SHORT: return "fewer usable samples than unknowns";
    case OKID_ERR_INPUT: return "an input is constant";
    case OKID_ERR_OUTPUT: return "an output is constant";
    case OKID_ERR_EXCITATION: return "the inputs do not excite enough";
    case OKID_ERR_NUMERIC: return "a factorisation did not converge";
    case OKID_ERR_UNSTABLE: return "no regularisation gives a stable model";
    case OKID_ERR_NO_MODES: return "the model has no underdamped mode";
    case OKID_ERR_FORMAT: return "the bytes are no serialised state of this version, or they are damaged";
    }
    return "unknown status";
}
