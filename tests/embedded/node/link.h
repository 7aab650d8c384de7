// SPDX-License-Identifier: MIT
/// @file link.h
/// The node's two directions of the serial line: packets of samples in (docs/wire-protocol.md), reports out.
///
/// In: the project's own packets (version 1), and commands of one byte >= 0xC0. Out: reports, byte 0 their kind
/// (LINK_REPORT_…), bytes 1 and 2 the number of the part, then at most LINK_PAYLOAD bytes. Both ways a CRC-32 of all before
/// it ends the packet, COBS stuffs it and one byte 0 closes it; little-endian.
#ifndef NODE_LINK_H
#define NODE_LINK_H

#include <drv/stream.h>

enum {
    LINK_PAYLOAD = 480,
    LINK_RESET = 0xC0,    ///< command: forget everything
    LINK_IDENTIFY = 0xC1, ///< command: identify; answered by LINK_REPORT_MODES
    LINK_STATE = 0xC2,    ///< command: the accumulator as okid_accumulator_serialise() writes it
    LINK_COUNTS = 0xC3,   ///< command: what was counted and measured
    LINK_REPORT_MODES = 0x81,
    LINK_REPORT_STATE = 0x82,
    LINK_REPORT_COUNTS = 0x83
};

/// A packet of samples, in the room it was received in: int16, sample by sample, inputs before outputs.
typedef struct link_samples_t {
    uint32_t sequence; ///< number of the first sample
    uint32_t count;    ///< samples
    const int16_t* codes;
} link_samples_t;

typedef enum link_event_t { LINK_SAMPLES, LINK_COMMAND, LINK_DAMAGED } link_event_t;

/// Wait for the next packet. LINK_DAMAGED: no packet, a wrong sum, or not `channels` channels of int16.
link_event_t link_receive(unsigned channels, link_samples_t* samples, uint8_t* command);

/// Ticks of the counter from the last byte of a packet to its samples, summed since reset.
uint32_t link_ticks(void);

/// Send a report in as many parts as it takes; at least one.
void link_report(uint8_t kind, const uint8_t* bytes, size_t count);

#endif
