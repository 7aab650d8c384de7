// SPDX-License-Identifier: MIT
// Any text as one line of a log, and as a whole log: no step beyond it, and what is written reads the same.
#include <drv/bus_load.h>
#include <drv/can_error.h>
#include <drv/candump.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

static void check_line(const char* line, size_t length) {
    drv_frame_t frame, again;
    drv_candump_error_t why;
    char interface[DRV_NAME_BYTES], name[DRV_NAME_BYTES], text[DRV_CANDUMP_BYTES];
    if (drv_candump_parse(line, length, &frame, interface, &why) != 0) {
        if (why.column < 1 || (size_t)why.column > length + 1 || !why.expected) abort();
        return;
    }
    if (frame.len > 64 || strlen(interface) >= DRV_NAME_BYTES) abort();
    frame.time_ns = frame.time_ns / 1000 * 1000; // a log is written at microseconds
    const int written = drv_candump_format(text, sizeof text, interface, &frame);
    if (written < 0 || drv_candump_parse(text, (size_t)written, &again, name, &why) != 0) abort();
    if (memcmp(&frame, &again, sizeof frame) != 0 || strcmp(interface, name) != 0) abort();
    (void)drv_wire_bits(&frame);
    char words[40];
    drv_can_error_text(frame.id, frame.data, words, sizeof words);
}

static void check_log(const uint8_t* data, size_t size) {
    static int file = -1;
    if (file < 0) file = memfd_create("log", 0);
    if (ftruncate(file, 0) != 0 || pwrite(file, data, size, 0) != (ssize_t)size) abort();
    char path[64];
    snprintf(path, sizeof path, "/proc/self/fd/%d", file);
    drv_source_t source;
    memset(&source, 0, sizeof source);
    source.ops = &drv_source_replay;
    drv_source_config_t config;
    memset(&config, 0, sizeof config);
    config.path = path;
    if (source.ops->open(&source, &config) != 0) abort();
    drv_frame_t frames[8];
    uint64_t delivered = 0;
    int got;
    while ((got = source.ops->read(&source, frames, 8)) > 0) delivered += (uint64_t)got;
    if (got == 0 || delivered != source.counts.received || (got != DRV_END && !source.error[0])) abort();
    source.ops->close(&source);
}

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    char* copy = malloc(size + 1); // no zero behind it
    memcpy(copy, data, size);
    check_line(copy, size);
    free(copy);
    check_log(data, size);
    return 0;
}
