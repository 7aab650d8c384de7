// SPDX-License-Identifier: MIT
// PURPOSE  the border between C++ and the C face: exceptions become exit codes and a sentence
#pragma once
#include "argument_words.hpp"
#include "error.hpp"

#include <exception>
#include <new>
#include <string>

namespace okid_host::face {

/// Keeps what okid_host_error() and okid_host_error_status() give to this thread. @return `code`
int keep_error(int code, const char* text, int status = 0) noexcept;

/// Runs `work()`; 0, or the exit code of what it threw.
template <class Work> int guard(Work&& work) noexcept {
    try {
        work();
        return exit_ok;
    } catch (const failure& error) {
        return keep_error(error.code, argument_words(error.what()).c_str(), error.status);
    } catch (const std::bad_alloc&) {
        return keep_error(exit_device, "out of memory");
    } catch (const std::exception& error) {
        return keep_error(exit_device, error.what());
    } catch (...) {
        return keep_error(exit_device, "internal error: an exception without a text");
    }
}

/// Throws `failure` (exit 2) when one is NULL.
template <class... Pointers> void given(const Pointers*... pointers) {
    if ((!pointers || ...)) throw failure(exit_usage, "found NULL, expected an object, a text or an array");
}

/// The same of what is read only when something is `there`.
template <class... Pointers> void given_where(bool there, const Pointers*... pointers) {
    if (there) given(pointers...);
}

} // namespace okid_host::face
