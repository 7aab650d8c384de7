// SPDX-License-Identifier: MIT
// PURPOSE  passwords stay in the file they stand in
// METHOD   what leaves the program (journals, messages) goes through here; a password file keeps them out of the config
#pragma once
#include <string>

namespace okid_host {

/// The user and password of an address (scheme://user:password@host) as "…".
std::string without_password(const std::string& address);

/// The same in all strings and comments of a TOML text; what it means is otherwise the same.
std::string without_passwords(const std::string& toml);

/// The one line of a password file. A plain name is looked for among the credentials of the service
/// ($CREDENTIALS_DIRECTORY) first, then beside `config`. Throws `failure` (exit 2); says when everybody can read the file.
std::string read_password(const std::string& name, const std::string& config);

} // namespace okid_host
