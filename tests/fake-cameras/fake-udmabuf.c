/* libcamera's virtual camera needs /dev/udmabuf or /dev/dma_heap for its buffers. On a kernel with
 * neither, LD_PRELOAD of this gives it plain memory files instead. And it can be unplugged: while
 * the file named by FAKE_UNPLUGGED is there, the camera's thread stands still, as a Pi's camera
 * does whose ribbon cable came loose.
 *
 * build: cc -shared -fPIC -O2 -o libfake-udmabuf.so fake-udmabuf.c -ldl
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/dma-buf.h>
#include <linux/udmabuf.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <unistd.h>

static int do_open(const char *symbol, const char *path, int flags, mode_t mode) {
    int (*real)(const char *, int, ...) = dlsym(RTLD_NEXT, symbol);
    int fd = real(path, flags, mode);
    /* Any file will do for the device: what it is asked is answered below. */
    if (fd < 0 && strcmp(path, "/dev/udmabuf") == 0) return memfd_create("fake-udmabuf", MFD_CLOEXEC);
    return fd;
}
static mode_t mode_of(int flags, va_list arguments) {
    return flags & (O_CREAT | __O_TMPFILE) ? va_arg(arguments, mode_t) : 0;
}
int open(const char *path, int flags, ...) {
    va_list a; va_start(a, flags); mode_t mode = mode_of(flags, a); va_end(a);
    return do_open("open", path, flags, mode);
}
int open64(const char *path, int flags, ...) {
    va_list a; va_start(a, flags); mode_t mode = mode_of(flags, a); va_end(a);
    return do_open("open64", path, flags, mode);
}
/* What open becomes where the compiler knows its flags (_FORTIFY_SOURCE). */
int __open_2(const char *path, int flags) { return do_open("open", path, flags, 0); }
int __open64_2(const char *path, int flags) { return do_open("open64", path, flags, 0); }

int ioctl(int fd, unsigned long request, ...) {
    int (*real)(int, unsigned long, ...) = dlsym(RTLD_NEXT, "ioctl");
    va_list a; va_start(a, request); void *argument = va_arg(a, void *); va_end(a);
    int result = real(fd, request, argument);
    if (result < 0 && errno == ENOTTY) {
        if (request == UDMABUF_CREATE)
            return fcntl(((struct udmabuf_create *)argument)->memfd, F_DUPFD_CLOEXEC, 3);
        if (request == DMA_BUF_IOCTL_SYNC) return 0;
    }
    return result;
}

/* The virtual camera maps a buffer for each frame, on a thread of its own. */
static void stand_still_while_unplugged(void) {
    char thread[16] = "";
    const char *unplugged = getenv("FAKE_UNPLUGGED");
    if (!unplugged || prctl(PR_GET_NAME, thread) || strncmp(thread, "VirtualCamera", 13)) return;
    while (access(unplugged, F_OK) == 0) usleep(10000);
}
void *mmap(void *at, size_t length, int protection, int flags, int fd, off_t offset) {
    void *(*real)(void *, size_t, int, int, int, off_t) = dlsym(RTLD_NEXT, "mmap");
    if (fd >= 0) stand_still_while_unplugged();
    return real(at, length, protection, flags, fd, offset);
}
void *mmap64(void *at, size_t length, int protection, int flags, int fd, off_t offset) {
    return mmap(at, length, protection, flags, fd, offset);
}
