// SPDX-License-Identifier: MIT
// A disk that misbehaves, for LD_PRELOAD: what is written to files whose name holds ".okj" stalls while the file named by
// OKID_STALL exists, and fails with the error number in the file named by OKID_DISK_ERROR while that exists.
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

static int to_journal(int fd) {
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    const ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = '\0';
    return strstr(path, ".okj") != NULL;
}

static void stall(void) {
    const char* name = getenv("OKID_STALL");
    while (name && access(name, F_OK) == 0) usleep(5000);
}

/// The error to give, 0 = none.
static int failing(void) {
    const char* name = getenv("OKID_DISK_ERROR");
    char text[16] = "";
    const int fd = name ? open(name, O_RDONLY | O_CLOEXEC) : -1;
    if (fd < 0) return 0;
    const ssize_t got = read(fd, text, sizeof text - 1);
    close(fd);
    return got > 0 ? atoi(text) : 0;
}

ssize_t write(int fd, const void* bytes, size_t count) {
    static ssize_t (*real)(int, const void*, size_t);
    if (!real) *(void**)&real = dlsym(RTLD_NEXT, "write");
    if (to_journal(fd)) {
        stall();
        const int code = failing();
        if (code) {
            errno = code;
            return -1;
        }
    }
    return real(fd, bytes, count);
}

int fdatasync(int fd) {
    static int (*real)(int);
    if (!real) *(void**)&real = dlsym(RTLD_NEXT, "fdatasync");
    if (to_journal(fd)) {
        stall();
        const int code = failing();
        if (code) {
            errno = code;
            return -1;
        }
    }
    return real(fd);
}
