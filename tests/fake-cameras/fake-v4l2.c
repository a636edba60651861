/* A USB camera that is not there: LD_PRELOAD answers V4L2 for one path, so that what talks to the
 * kernel's V4L2 runs unchanged on a machine without a camera (or without V4L2 in its kernel).
 *
 * FAKE_V4L2 is a folder with
 *   video0   the device's path; an empty file
 *   format   GREY, YUYV or MJPG
 *   0 1 2 …  payloads of the frames, shown in turn, 90 a second, 640x480
 *   gone     once it is there the camera is unplugged: ENODEV
 *   busy     once it is there another program streams: EBUSY
 *   denied   once it is there it may not be opened: EACCES
 *   log      gets a line "control value" for each control that is set
 * A reader that keeps all buffers loses frames, as with a camera: numbers go on.
 *
 * build: cc -shared -fPIC -O2 -o libfake-v4l2.so fake-v4l2.c -ldl
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

enum { WIDTH = 640, HEIGHT = 480, RATE = 90, MAX_BUFFERS = 8, BUFFER_BYTES = 1 << 20 };
static const long long PERIOD_NS = 1000000000LL / RATE;

static int fd = -1;
static int queue[MAX_BUFFERS], n_queued;
static long long started_ns, next_frame;
static int exposure = 156, gain = 4;

static const char *in_folder(const char *name) {
    static char path[4096];
    const char *folder = getenv("FAKE_V4L2");
    snprintf(path, sizeof path, "%s/%s", folder ? folder : "/nowhere", name);
    return path;
}
static int is_there(const char *name) { return access(in_folder(name), F_OK) == 0; }
static long long now_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}
static unsigned fourcc(void) {
    char name[5] = "GREY";
    FILE *f = fopen(in_folder("format"), "r");
    if (f) {
        if (fread(name, 1, 4, f) != 4) memcpy(name, "GREY", 4);
        fclose(f);
    }
    return v4l2_fourcc(name[0], name[1], name[2], name[3]);
}
static long long due_ns(long long frame) { return started_ns + (frame + 1) * PERIOD_NS; }

static int do_open(const char *symbol, const char *path, int flags, mode_t mode) {
    int (*real)(const char *, int, ...) = dlsym(RTLD_NEXT, symbol);
    char device[4096];
    snprintf(device, sizeof device, "%s", in_folder("video0"));
    if (strcmp(path, device) != 0) return real(path, flags, mode);
    if (is_there("denied")) return errno = EACCES, -1;
    if (is_there("gone")) return errno = ENODEV, -1;
    fd = memfd_create("fake-v4l2", MFD_CLOEXEC);
    if (fd >= 0 && ftruncate(fd, (off_t)MAX_BUFFERS * BUFFER_BYTES)) return -1;
    return fd;
}
int open(const char *path, int flags, ...) {
    va_list a; va_start(a, flags); mode_t mode = va_arg(a, mode_t); va_end(a);
    return do_open("open", path, flags, mode);
}
int open64(const char *path, int flags, ...) {
    va_list a; va_start(a, flags); mode_t mode = va_arg(a, mode_t); va_end(a);
    return do_open("open64", path, flags, mode);
}

int poll(struct pollfd *fds, nfds_t n, int timeout_ms) {
    int (*real)(struct pollfd *, nfds_t, int) = dlsym(RTLD_NEXT, "poll");
    if (fd < 0 || n != 1 || fds[0].fd != fd) return real(fds, n, timeout_ms);
    long long until = now_ns() + timeout_ms * 1000000LL;
    for (;;) {
        if (is_there("gone")) return fds[0].revents = POLLERR, 1;
        long long now = now_ns();
        if (n_queued && now >= due_ns(next_frame)) return fds[0].revents = POLLIN, 1;
        if (timeout_ms >= 0 && now >= until) return fds[0].revents = 0, 0;
        usleep(500);
    }
}

static void fmt_of(struct v4l2_format *f) {
    struct v4l2_pix_format *p = &f->fmt.pix;
    unsigned row = fourcc() == V4L2_PIX_FMT_YUYV ? 2 * WIDTH : WIDTH;
    memset(p, 0, sizeof *p);
    p->width = WIDTH, p->height = HEIGHT, p->pixelformat = fourcc(), p->field = V4L2_FIELD_NONE;
    p->bytesperline = fourcc() == V4L2_PIX_FMT_MJPEG ? 0 : row;
    p->sizeimage = BUFFER_BYTES, p->colorspace = V4L2_COLORSPACE_SRGB;
}
static int *control(unsigned id) {
    static int automatic = 3;
    switch (id) {
    case V4L2_CID_EXPOSURE_AUTO: return &automatic;
    case V4L2_CID_EXPOSURE_ABSOLUTE: return &exposure;
    case V4L2_CID_GAIN: return &gain;
    }
    return NULL;
}
static unsigned fill(int idx, long long frame) {
    char name[32];
    int n = 0;
    do snprintf(name, sizeof name, "%d", n); while (is_there(name) && ++n);
    if (n == 0) return 0;
    snprintf(name, sizeof name, "%lld", frame % n);
    FILE *f = fopen(in_folder(name), "r");
    if (!f) return 0;
    char *at = mmap(NULL, BUFFER_BYTES, PROT_WRITE, MAP_SHARED, fd, (off_t)idx * BUFFER_BYTES);
    unsigned used = at == MAP_FAILED ? 0 : fread(at, 1, BUFFER_BYTES, f);
    if (at != MAP_FAILED) munmap(at, BUFFER_BYTES);
    fclose(f);
    return used;
}

static int answer(unsigned long request, void *arg) {
    if (is_there("gone")) return ENODEV;
    switch (request) {
    case VIDIOC_QUERYCAP: {
        struct v4l2_capability *c = arg;
        memset(c, 0, sizeof *c);
        strcpy((char *)c->driver, "fake"), strcpy((char *)c->card, "Fake USB camera");
        c->device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
        c->capabilities = c->device_caps | V4L2_CAP_DEVICE_CAPS;
        return 0;
    }
    case VIDIOC_ENUM_FMT: {
        struct v4l2_fmtdesc *d = arg;
        if (d->index) return EINVAL;
        d->pixelformat = fourcc(), strcpy((char *)d->description, "fake");
        return 0;
    }
    case VIDIOC_ENUM_FRAMESIZES: {
        struct v4l2_frmsizeenum *s = arg;
        if (s->index) return EINVAL;
        s->type = V4L2_FRMSIZE_TYPE_DISCRETE, s->discrete.width = WIDTH, s->discrete.height = HEIGHT;
        return 0;
    }
    case VIDIOC_ENUM_FRAMEINTERVALS: {
        struct v4l2_frmivalenum *i = arg;
        if (i->index) return EINVAL;
        i->type = V4L2_FRMIVAL_TYPE_DISCRETE, i->discrete.numerator = 1, i->discrete.denominator = RATE;
        return 0;
    }
    case VIDIOC_S_FMT:
        if (is_there("busy")) return EBUSY; /* fall through */
    case VIDIOC_G_FMT: return fmt_of(arg), 0;
    case VIDIOC_S_PARM:
    case VIDIOC_G_PARM: {
        struct v4l2_streamparm *p = arg;
        memset(&p->parm, 0, sizeof p->parm);
        p->parm.capture.capability = V4L2_CAP_TIMEPERFRAME;
        p->parm.capture.timeperframe.numerator = 1, p->parm.capture.timeperframe.denominator = RATE;
        return 0;
    }
    case VIDIOC_QUERY_EXT_CTRL: {
        struct v4l2_query_ext_ctrl *q = arg;
        if (!control(q->id)) return EINVAL;
        q->type = q->id == V4L2_CID_EXPOSURE_AUTO ? V4L2_CTRL_TYPE_MENU : V4L2_CTRL_TYPE_INTEGER;
        q->minimum = 0, q->maximum = 5000, q->step = 1;
        return 0;
    }
    case VIDIOC_G_EXT_CTRLS:
    case VIDIOC_S_EXT_CTRLS: {
        struct v4l2_ext_controls *c = arg;
        if (c->count != 1 || !control(c->controls[0].id)) return EINVAL;
        if (request == VIDIOC_G_EXT_CTRLS) return c->controls[0].value = *control(c->controls[0].id), 0;
        *control(c->controls[0].id) = c->controls[0].value;
        FILE *log = fopen(in_folder("log"), "a");
        if (log) fprintf(log, "%#x %d\n", c->controls[0].id, c->controls[0].value), fclose(log);
        return 0;
    }
    case VIDIOC_REQBUFS: {
        struct v4l2_requestbuffers *r = arg;
        if (is_there("busy")) return EBUSY;
        if (r->count > MAX_BUFFERS) r->count = MAX_BUFFERS;
        n_queued = 0;
        return 0;
    }
    case VIDIOC_QUERYBUF: {
        struct v4l2_buffer *b = arg;
        b->length = BUFFER_BYTES, b->m.offset = b->index * BUFFER_BYTES;
        return 0;
    }
    case VIDIOC_QBUF: {
        int idx = ((struct v4l2_buffer *)arg)->index;
        for (int k = 0; k < n_queued; k++)
            if (queue[k] == idx) return EINVAL; /* as the kernel: it has this one already */
        queue[n_queued++] = idx;
        return 0;
    }
    case VIDIOC_DQBUF: {
        struct v4l2_buffer *b = arg;
        long long due = (now_ns() - started_ns) / PERIOD_NS - 1; /* the newest that is over */
        if (!n_queued || due < next_frame) return EAGAIN;
        if (due - next_frame >= n_queued) next_frame = due - n_queued + 1; /* these had no buffer */
        b->index = queue[0];
        memmove(queue, queue + 1, --n_queued * sizeof *queue);
        b->bytesused = fill(b->index, next_frame);
        b->flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
        b->field = V4L2_FIELD_NONE, b->sequence = next_frame;
        long long stamp = due_ns(next_frame++) - PERIOD_NS;
        b->timestamp.tv_sec = stamp / 1000000000LL, b->timestamp.tv_usec = stamp % 1000000000LL / 1000;
        return 0;
    }
    case VIDIOC_STREAMON: return started_ns = now_ns(), next_frame = 0, 0;
    case VIDIOC_STREAMOFF: return n_queued = 0, 0;
    }
    return EINVAL;
}

long syscall(long number, ...) {
    static long (*real)(long, ...);
    if (!real) real = (long (*)(long, ...))dlsym(RTLD_NEXT, "syscall");
    va_list v; va_start(v, number);
    long a = va_arg(v, long), b = va_arg(v, long), c = va_arg(v, long);
    long d = va_arg(v, long), e = va_arg(v, long), f = va_arg(v, long);
    va_end(v);
    if (number != SYS_ioctl || fd < 0 || a != fd) return real(number, a, b, c, d, e, f);
    int failed = answer((unsigned long)b, (void *)c);
    return failed ? (errno = failed, -1) : 0;
}
int close(int other) {
    int (*real)(int) = dlsym(RTLD_NEXT, "close");
    if (other == fd) fd = -1;
    return real(other);
}
