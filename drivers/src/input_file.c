// SPDX-License-Identifier: MIT
// PURPOSE  open what is to be read, and only files
// METHOD   the kind is looked at before the file is opened, because opening a device may do something, and again afterwards,
//          because another file may stand there by then
#include <drv/input_file.h>

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/// A name for a descriptor that is open already.
static int names_descriptor(const char* path) {
    return strcmp(path, "/dev/stdin") == 0 || strncmp(path, "/dev/fd/", 8) == 0 ||
           strncmp(path, "/proc/self/fd/", 14) == 0;
}

static int kind_fault(const struct stat* status, const char* path) {
    if (S_ISREG(status->st_mode)) return 0;
    if (S_ISDIR(status->st_mode)) return EISDIR;
    return S_ISFIFO(status->st_mode) && names_descriptor(path) ? 0 : ENOTSUP;
}

int drv_input_open(const char* path) {
    struct stat status;
    int code = stat(path, &status) == 0 ? kind_fault(&status, path) : errno;
    if (code) return -code;
    const int wait = S_ISFIFO(status.st_mode) ? 0 : O_NONBLOCK; // if a pipe has replaced the file, this does not wait
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NOCTTY | wait);
    if (fd < 0) return -errno;
    code = fstat(fd, &status) == 0 ? kind_fault(&status, path) : errno;
    if (code) close(fd);
    return code ? -code : fd;
}

const char* drv_input_fault(int code) {
    const int reason = code < 0 ? -code : code;
    return reason == ENOTSUP ? "it is a device or a named pipe, expected a file (a pipe can be given as /dev/stdin)"
                             : strerror(reason);
}
