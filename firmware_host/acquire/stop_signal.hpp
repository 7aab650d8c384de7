// SPDX-License-Identifier: MIT
// SIGINT and SIGTERM ask a session to end; it then finishes in order. SIGHUP asks it to open its events file again.
#pragma once

namespace okid_host {

/// From now on the two signals set a flag instead of ending the process; a second one ends it at once.
/// A pipe or socket whose reader is gone is an error of write(), not the end of the process.
void catch_stop_signals();
bool stop_requested();
/// Becomes readable when a stop is asked for; for poll().
int stop_fd();

/// From now on SIGHUP of a process (kill -HUP, logrotate) is counted; that of a terminal which hung up is a request to stop.
void catch_hangups();
int reopen_requests();

} // namespace okid_host
