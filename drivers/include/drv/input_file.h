// SPDX-License-Identifier: MIT
/// @file input_file.h
/// Files that are read: what is no file is refused before it is opened, so that nothing waits, sets off a device or never
/// ends.
#ifndef DRV_INPUT_FILE_H
#define DRV_INPUT_FILE_H

#ifdef __cplusplus
extern "C" {
#endif

/// Open a file for reading. A folder, a device, a socket and a named pipe are refused at once; a pipe that is open already is
/// taken by its name (/dev/stdin, /dev/fd/N).
/// @return a descriptor, or -errno; -ENOTSUP = not a file
int drv_input_open(const char* path);

/// What is wrong with it, for a message: of a code of drv_input_open().
const char* drv_input_fault(int code);

#ifdef __cplusplus
}
#endif
#endif
