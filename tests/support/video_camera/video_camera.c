// A V4L2 capture device in user space, by LD_PRELOAD: for programs that open it, ask it by ioctl (themselves or through
// syscall), poll it and map its buffers.
//
// The device is a memory file, so mapping and closing it need nothing. A thread is the camera: at every frame's time it
// fills the next free buffer with what stands in the folder then, as a real camera does whether anybody looks or not.
//
// The environment:  GRAINRIG_VIDEO        path of the device
//                   GRAINRIG_VIDEO_DIR    folder with `frame` (the bytes of a frame) and `fault` (a word, or nothing):
//                                         gone, held, bandwidth, stall, cut, forgets
//                   GRAINRIG_VIDEO_SCENE  a socket that is asked for each frame instead: a byte goes there, the number of
//                                         the frame's bytes (four of them, the least first) and the frame come back
//                   GRAINRIG_VIDEO_SIZE   the picture, as 640x480; 324x216 where it is not said
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

enum { FPS = 50, BUFFERS = 8, BUFFER_BYTES = 1 << 20 };
static unsigned width = 324, height = 216;

struct control {
    __u32 id, type;
    const char *name;
    int least, most, value;
};

// In the order of their numbers, as they are asked for. The first half of each pair governs the second.
static struct control controls[] = {
    {V4L2_CID_AUTO_WHITE_BALANCE, V4L2_CTRL_TYPE_BOOLEAN, "White Balance, Automatic", 0, 1, 1},
    {V4L2_CID_WHITE_BALANCE_TEMPERATURE, V4L2_CTRL_TYPE_INTEGER, "White Balance Temperature", 2800, 6500, 4000},
    {V4L2_CID_EXPOSURE_AUTO, V4L2_CTRL_TYPE_MENU, "Auto Exposure", 0, 3, 3},
    {V4L2_CID_EXPOSURE_ABSOLUTE, V4L2_CTRL_TYPE_INTEGER, "Exposure Time, Absolute", 3, 2047, 250},
};
enum { CONTROLS = sizeof controls / sizeof *controls };

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t filled = PTHREAD_COND_INITIALIZER;
static int device = -1, streaming, buffers;
static unsigned generation, sequence;
static __u32 format = V4L2_PIX_FMT_MJPEG;
static int queue[BUFFERS], queued, done[BUFFERS], finished;
static size_t used[BUFFERS];
static struct timeval dated[BUFFERS];
static unsigned numbered[BUFFERS];

static int (*real_open)(const char *, int, ...);
static long (*real_syscall)(long, ...);
static int (*real_poll)(struct pollfd *, nfds_t, int);

__attribute__((constructor)) static void begin(void) {
    real_open = dlsym(RTLD_NEXT, "open");
    real_syscall = dlsym(RTLD_NEXT, "syscall");
    real_poll = dlsym(RTLD_NEXT, "poll");
    const char *size = getenv("GRAINRIG_VIDEO_SIZE");
    if (size && (sscanf(size, "%ux%u", &width, &height) != 2 || 2 * width * height > BUFFER_BYTES)) {
        fprintf(stderr, "video_camera: GRAINRIG_VIDEO_SIZE is %s\n", size);
        _exit(2);
    }
}

static int refuse(int reason) {
    errno = reason;
    return -1;
}

static size_t read_file(const char *name, void *into, size_t most) {
    char path[4096];
    const char *folder = getenv("GRAINRIG_VIDEO_DIR");
    snprintf(path, sizeof path, "%s/%s", folder ? folder : ".", name);
    int file = real_open(path, O_RDONLY | O_CLOEXEC);
    ssize_t n = file < 0 ? 0 : read(file, into, most);
    if (file >= 0)
        close(file);
    return n < 0 ? 0 : (size_t)n;
}

static int fault_is(const char *word) {
    char is[32] = "";
    size_t n = read_file("fault", is, sizeof is - 1);
    is[n] = 0;
    return strcmp(is, word) == 0;
}

// All of so many bytes, either way; whether they went.
static int whole(int line, void *bytes, size_t count, int out) {
    while (count) {
        ssize_t n = out ? send(line, bytes, count, MSG_NOSIGNAL) : recv(line, bytes, count, 0);
        if (n <= 0)
            return 0;
        bytes = (char *)bytes + n;
        count -= (size_t)n;
    }
    return 1;
}

// What is before the lens now.
static size_t expose(void *into) {
    static int line = -1;
    const char *scene = getenv("GRAINRIG_VIDEO_SCENE");
    if (!scene)
        return read_file("frame", into, BUFFER_BYTES);
    // The thread of a stream that has ended may still be at it.
    static pthread_mutex_t asking = PTHREAD_MUTEX_INITIALIZER;
    pthread_mutex_lock(&asking);
    if (line < 0) {
        struct sockaddr_un at = {.sun_family = AF_UNIX};
        snprintf(at.sun_path, sizeof at.sun_path, "%s", scene);
        line = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
        if (connect(line, (struct sockaddr *)&at, sizeof at))
            perror("video_camera: the scene");
    }
    unsigned char ask = 1, n[4];
    size_t bytes = 0;
    if (whole(line, &ask, 1, 1) && whole(line, n, 4, 0))
        bytes = n[0] | n[1] << 8 | n[2] << 16 | (size_t)n[3] << 24;
    if (bytes > BUFFER_BYTES || !whole(line, into, bytes, 0))
        bytes = 0;
    pthread_mutex_unlock(&asking);
    return bytes;
}

static void *camera(void *mine) {
    unsigned my_generation = (unsigned)(size_t)mine;
    struct timespec due, now;
    clock_gettime(CLOCK_MONOTONIC, &due);
    for (;;) {
        due.tv_nsec += 1000000000 / FPS;
        if (due.tv_nsec >= 1000000000) {
            due.tv_nsec -= 1000000000;
            due.tv_sec++;
        }
        // A scene that takes longer than a frame does costs frames.
        clock_gettime(CLOCK_MONOTONIC, &now);
        if (now.tv_sec > due.tv_sec || (now.tv_sec == due.tv_sec && now.tv_nsec > due.tv_nsec))
            due = now;
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, 0);
        pthread_mutex_lock(&lock);
        if (!streaming || generation != my_generation) {
            pthread_mutex_unlock(&lock);
            return 0;
        }
        if (fault_is("gone"))
            pthread_cond_broadcast(&filled);
        sequence++;
        if (!queued || fault_is("stall")) {
            pthread_mutex_unlock(&lock);
            continue;
        }
        int index = queue[0];
        unsigned number = sequence;
        memmove(queue, queue + 1, --queued * sizeof *queue);
        pthread_mutex_unlock(&lock);
        // What is seen is later than the frame's date, never earlier.
        void *bytes = mmap(0, BUFFER_BYTES, PROT_READ | PROT_WRITE, MAP_SHARED, device, (off_t)index * BUFFER_BYTES);
        size_t got = expose(bytes);
        munmap(bytes, BUFFER_BYTES);
        pthread_mutex_lock(&lock);
        if (streaming && generation == my_generation) {
            used[index] = fault_is("cut") ? got / 2 : got;
            dated[index] = (struct timeval){due.tv_sec, due.tv_nsec / 1000};
            numbered[index] = number;
            done[finished++] = index;
            pthread_cond_broadcast(&filled);
        }
        pthread_mutex_unlock(&lock);
    }
}

static int stream_on(void) {
    if (fault_is("bandwidth"))
        return refuse(ENOSPC);
    // What was set before is forgotten.
    for (int i = 0; i < CONTROLS; i += 2)
        controls[i].value = controls[i].most;
    streaming = 1;
    generation++;
    pthread_t thread;
    pthread_attr_t detached;
    pthread_attr_init(&detached);
    pthread_attr_setdetachstate(&detached, PTHREAD_CREATE_DETACHED);
    return pthread_create(&thread, &detached, camera, (void *)(size_t)generation) ? refuse(EIO) : 0;
}

static struct control *control(__u32 id) {
    for (int i = 0; i < CONTROLS; i++)
        if (controls[i].id == id)
            return &controls[i];
    return 0;
}

// A control that an automatic one governs can't be set: whether that is so.
static int governed(const struct control *c) {
    long i = c - controls;
    return i % 2 && controls[i - 1].value == controls[i - 1].most;
}

static int query_control(struct v4l2_query_ext_ctrl *asked) {
    __u32 next = V4L2_CTRL_FLAG_NEXT_CTRL | V4L2_CTRL_FLAG_NEXT_COMPOUND, id = asked->id & ~next;
    for (int i = 0; i < CONTROLS; i++) {
        struct control *c = &controls[i];
        if (asked->id & next ? c->id <= id : c->id != id)
            continue;
        memset(asked, 0, sizeof *asked);
        asked->id = c->id;
        asked->type = c->type;
        strcpy(asked->name, c->name);
        asked->minimum = c->least;
        asked->maximum = c->most;
        asked->step = asked->elems = 1;
        asked->elem_size = 4;
        asked->flags = governed(c) ? V4L2_CTRL_FLAG_INACTIVE : 0;
        return 0;
    }
    return refuse(EINVAL);
}

static int set_control(struct v4l2_ext_controls *asked) {
    struct control *c = control(asked->controls[0].id);
    int value = asked->controls[0].value;
    if (!c)
        return refuse(EINVAL);
    if (value < c->least || value > c->most)
        return refuse(ERANGE);
    if (governed(c))
        return refuse(EACCES);
    c->value = value;
    return 0;
}

static int get_control(struct v4l2_ext_controls *asked) {
    struct control *c = control(asked->controls[0].id);
    if (!c)
        return refuse(EINVAL);
    if (fault_is("forgets") && streaming)
        controls[2].value = controls[2].most;
    asked->controls[0].value = c->value;
    return 0;
}

static int ask(unsigned long request, void *argument) {
    if (fault_is("gone"))
        return refuse(ENODEV);
    switch ((__u32)request) {
    case VIDIOC_QUERYCAP: {
        struct v4l2_capability *c = argument;
        memset(c, 0, sizeof *c);
        strcpy((char *)c->driver, "simulated");
        strcpy((char *)c->card, "Simulated video camera");
        strcpy((char *)c->bus_info, "platform:simulated");
        c->device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
        c->capabilities = c->device_caps | V4L2_CAP_DEVICE_CAPS;
        return 0;
    }
    case VIDIOC_S_FMT:
        if (fault_is("held"))
            return refuse(EBUSY);
        format = ((struct v4l2_format *)argument)->fmt.pix.pixelformat == V4L2_PIX_FMT_YUYV ? V4L2_PIX_FMT_YUYV
                                                                                             : V4L2_PIX_FMT_MJPEG;
        /* fallthrough */
    case VIDIOC_G_FMT: {
        struct v4l2_pix_format *pixels = &((struct v4l2_format *)argument)->fmt.pix;
        memset(pixels, 0, sizeof *pixels);
        pixels->width = width;
        pixels->height = height;
        pixels->pixelformat = format;
        pixels->field = V4L2_FIELD_NONE;
        pixels->bytesperline = format == V4L2_PIX_FMT_YUYV ? 2 * width : 0;
        pixels->sizeimage = BUFFER_BYTES;
        pixels->colorspace = V4L2_COLORSPACE_SRGB;
        return 0;
    }
    case VIDIOC_S_PARM:
    case VIDIOC_G_PARM: {
        struct v4l2_captureparm *p = &((struct v4l2_streamparm *)argument)->parm.capture;
        p->capability = V4L2_CAP_TIMEPERFRAME;
        p->timeperframe = (struct v4l2_fract){1, FPS};
        return 0;
    }
    case VIDIOC_QUERY_EXT_CTRL:
        return query_control(argument);
    case VIDIOC_S_EXT_CTRLS:
        return set_control(argument);
    case VIDIOC_G_EXT_CTRLS:
        return get_control(argument);
    case VIDIOC_REQBUFS: {
        struct v4l2_requestbuffers *b = argument;
        if (b->memory != V4L2_MEMORY_MMAP)
            return refuse(EINVAL);
        if (b->count > BUFFERS)
            b->count = BUFFERS;
        buffers = (int)b->count;
        queued = finished = 0;
        return ftruncate(device, (off_t)BUFFERS * BUFFER_BYTES);
    }
    case VIDIOC_QUERYBUF: {
        struct v4l2_buffer *b = argument;
        b->length = BUFFER_BYTES;
        b->m.offset = b->index * BUFFER_BYTES;
        return 0;
    }
    case VIDIOC_QBUF: {
        int index = (int)((struct v4l2_buffer *)argument)->index;
        // A buffer that the camera has can't be given to it again.
        for (int i = 0; i < queued; i++)
            if (queue[i] == index)
                return refuse(EINVAL);
        if (index >= buffers || queued == BUFFERS)
            return refuse(EINVAL);
        queue[queued++] = index;
        return 0;
    }
    case VIDIOC_DQBUF: {
        struct v4l2_buffer *b = argument;
        if (!finished)
            return refuse(EAGAIN);
        int index = done[0];
        memmove(done, done + 1, --finished * sizeof *done);
        b->index = (__u32)index;
        b->bytesused = (__u32)used[index];
        b->sequence = numbered[index];
        b->timestamp = dated[index];
        b->flags = V4L2_BUF_FLAG_MAPPED | V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
        b->field = V4L2_FIELD_NONE;
        return 0;
    }
    case VIDIOC_STREAMON:
        return stream_on();
    case VIDIOC_STREAMOFF:
        streaming = 0;
        queued = finished = 0;
        return 0;
    }
    return refuse(ENOTTY);
}

static int open_device(int flags) {
    if (fault_is("gone"))
        return refuse(ENODEV);
    pthread_mutex_lock(&lock);
    streaming = 0;
    device = memfd_create("video", flags & O_CLOEXEC ? MFD_CLOEXEC : 0);
    pthread_mutex_unlock(&lock);
    return device;
}

static int is_device(const char *path) {
    const char *mine = getenv("GRAINRIG_VIDEO");
    return mine && strcmp(path, mine) == 0;
}

static int mode_of(int flags, va_list more) { return flags & (O_CREAT | O_TMPFILE) ? va_arg(more, int) : 0; }

int open(const char *path, int flags, ...) {
    va_list more;
    va_start(more, flags);
    int mode = mode_of(flags, more);
    va_end(more);
    return is_device(path) ? open_device(flags) : real_open(path, flags, mode);
}

int open64(const char *path, int flags, ...) {
    va_list more;
    va_start(more, flags);
    int mode = mode_of(flags, more);
    va_end(more);
    return is_device(path) ? open_device(flags) : real_open(path, flags | O_LARGEFILE, mode);
}

// The crate asks by the system call's number.
long syscall(long number, ...) {
    va_list more;
    va_start(more, number);
    long a[6];
    for (int i = 0; i < 6; i++)
        a[i] = va_arg(more, long);
    va_end(more);
    if (number == SYS_ioctl && device >= 0 && (int)a[0] == device && ((a[1] >> 8) & 255) == 'V') {
        pthread_mutex_lock(&lock);
        int result = ask((unsigned long)a[1], (void *)a[2]);
        int reason = errno;
        pthread_mutex_unlock(&lock);
        errno = reason;
        return result;
    }
    return real_syscall(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}

int poll(struct pollfd *asked, nfds_t count, int patience_ms) {
    if (count != 1 || device < 0 || asked->fd != device)
        return real_poll(asked, count, patience_ms);
    struct timespec end;
    clock_gettime(CLOCK_REALTIME, &end);
    end.tv_sec += patience_ms / 1000;
    end.tv_nsec += patience_ms % 1000 * 1000000L;
    if (end.tv_nsec >= 1000000000) {
        end.tv_nsec -= 1000000000;
        end.tv_sec++;
    }
    pthread_mutex_lock(&lock);
    int late = 0;
    while (!finished && !late && !fault_is("gone"))
        late = pthread_cond_timedwait(&filled, &lock, &end);
    asked->revents = finished ? POLLIN : late ? 0 : POLLERR;
    pthread_mutex_unlock(&lock);
    return asked->revents ? 1 : 0;
}
