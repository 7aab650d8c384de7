// SPDX-License-Identifier: MIT
// A [[channel]] to bits in frames: by message and signal of the DBC, or by identifier and start bit.
#pragma once
#include "config.hpp"
#include "config_schema.hpp"
#include "dbc.hpp"

namespace okid_host {

/// The J1939 group of bits 8 to 25 of an identifier: the destination of a message to one address (PDU1) is not part of it.
std::uint32_t j1939_group(std::uint32_t number);

/// Fill frame, length, layout, selector, sequence and unit of `channel`. `dbc` is that of the channel's bus, or NULL.
void resolve_channel(const config_place& place, const toml::table& table, const bus_config& bus, const dbc_file* dbc,
                     channel_config& channel);

} // namespace okid_host
