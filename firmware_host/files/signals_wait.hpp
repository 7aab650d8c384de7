// SPDX-License-Identifier: MIT
// Signals wait while a piece of work is done.
#pragma once
#include <csignal>
#include <initializer_list>

namespace okid_host {

/// No signal is delivered to this thread, nor to threads started from it, while this lives.
class signals_wait {
  public:
    /// All signals.
    signals_wait() {
        sigset_t these;
        sigfillset(&these);
        pthread_sigmask(SIG_SETMASK, &these, &before_);
    }
    /// These only.
    signals_wait(std::initializer_list<int> signals) {
        sigset_t these;
        sigemptyset(&these);
        for (const int one : signals) sigaddset(&these, one);
        pthread_sigmask(SIG_BLOCK, &these, &before_);
    }
    ~signals_wait() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
    signals_wait(const signals_wait&) = delete;
    signals_wait& operator=(const signals_wait&) = delete;

  private:
    sigset_t before_{};
};

} // namespace okid_host
