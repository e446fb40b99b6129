/* Faults put between a program and its C library (LD_PRELOAD).
 *
 * SELVEDGE_FAULT="SIDE K KIND" lets the K-th call of a side fail. With K = 0 nothing fails, and the
 * number of calls is written to the file SELVEDGE_FAULT_COUNT.
 *
 * writes: open to write, write, fchmod, fsync, rename of a regular file. KIND is an error
 *   ("enospc", "eio", "eintr", "eacces"), "short" (a write of half of it), "cut" (the process ends
 *   there) or "drop": the power is cut, what was written since the last fsync of its file is lost,
 *   and so are renames whose folder was not synced since.
 * reads: open to read, read and listing of what lies in the folder SELVEDGE_FAULT_FOLDER. KIND is
 *   "eio", "eintr" or "short". The path is written to the file SELVEDGE_FAULT_PATH.
 * memory: an allocation of LARGE bytes and more. KIND is "enomem".
 */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

enum { MOST = 4096, LARGE = 4096 };

static pthread_mutex_t guard = PTHREAD_MUTEX_INITIALIZER;
static long at = 0, count = 0;
/* 'w', 'r' or 'm'; none before the library has begun. */
static char side = 0;
static char kind[16];
static const char *folder = "/";

/* Files that were written, by a descriptor of our own, with the size that is surely on the disk. */
static struct { dev_t dev; ino_t ino; int fd; off_t synced; } files[MOST];
static int file_count = 0;
/* Renames whose folder was not synced since, with what stood there before. */
static struct { char from[1024], to[1024], before[1100]; int had; } renames[MOST];
static int rename_count = 0;

static void *next(const char *name) { return dlsym(RTLD_NEXT, name); }

__attribute__((constructor)) static void begin(void) {
    const char *text = getenv("SELVEDGE_FAULT");
    char word[16] = "";
    if (!text || sscanf(text, "%15s %ld %15s", word, &at, kind) != 3) return;
    if (getenv("SELVEDGE_FAULT_FOLDER")) folder = getenv("SELVEDGE_FAULT_FOLDER");
    side = word[0];
}

static int is_regular(int fd) {
    struct stat s;
    return fstat(fd, &s) == 0 && S_ISREG(s.st_mode);
}

static int find(int fd, int add) {
    struct stat s;
    if (fstat(fd, &s) != 0) return -1;
    for (int k = 0; k < file_count; k++)
        if (files[k].dev == s.st_dev && files[k].ino == s.st_ino) return k;
    if (!add || file_count == MOST) return -1;
    files[file_count].dev = s.st_dev;
    files[file_count].ino = s.st_ino;
    files[file_count].fd = dup(fd);
    /* What was there before this process wrote. */
    files[file_count].synced = s.st_size;
    return file_count++;
}

static void lose(void) {
    int (*do_rename)(const char *, const char *) = next("rename");
    for (int k = rename_count; k-- > 0;) {
        do_rename(renames[k].to, renames[k].from);
        if (renames[k].had) do_rename(renames[k].before, renames[k].to);
    }
    for (int k = 0; k < file_count; k++)
        if (ftruncate(files[k].fd, files[k].synced) != 0) _exit(99);
}

/* The error of this call: 0 for none, -1 for a short write. */
static int fault(void) {
    count++;
    if (at == 0 || count != at) return 0;
    if (!strcmp(kind, "drop")) lose();
    if (!strcmp(kind, "drop") || !strcmp(kind, "cut")) _exit(137);
    if (!strcmp(kind, "enospc")) return ENOSPC;
    if (!strcmp(kind, "eio")) return EIO;
    if (!strcmp(kind, "eintr")) return EINTR;
    if (!strcmp(kind, "eacces")) return EACCES;
    if (!strcmp(kind, "enomem")) return ENOMEM;
    return -1;
}

static int locked_fault(char of) {
    if (of != side) return 0;
    pthread_mutex_lock(&guard);
    int error = fault();
    pthread_mutex_unlock(&guard);
    if (error > 0) errno = error;
    return error;
}

/* The error of a read of what stands at `path`, where that lies in the folder. */
static int read_fault(const char *path) {
    if (side != 'r' || strncmp(path, folder, strlen(folder))) return 0;
    int error = locked_fault('r');
    const char *to = getenv("SELVEDGE_FAULT_PATH");
    if (error != 0 && to) {
        int fd = syscall(SYS_openat, AT_FDCWD, to, O_WRONLY | O_CREAT | O_TRUNC, 0600);
        if (fd < 0 || syscall(SYS_write, fd, path, strlen(path)) < 0) _exit(99);
        syscall(SYS_close, fd);
    }
    return error;
}

static int read_fault_of(int fd) {
    char link[64], path[4096];
    if (side != 'r') return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    return read_fault(path);
}

static int open_as(const char *name, const char *path, int flags, mode_t mode) {
    int (*real)(const char *, int, ...) = next(name);
    if ((flags & O_CREAT) && strncmp(path, "/proc", 5) && strncmp(path, "/dev", 4) &&
        locked_fault('w') > 0)
        return -1;
    if (side == 'r' && !(flags & O_CREAT)) {
        char *whole = realpath(path, NULL);
        int error = whole ? read_fault(whole) : 0;
        free(whole);
        if (error > 0) {
            errno = error;
            return -1;
        }
    }
    return real(path, flags, mode);
}

ssize_t read(int fd, void *bytes, size_t length) {
    ssize_t (*real)(int, void *, size_t) = next("read");
    int error = read_fault_of(fd);
    if (error > 0) errno = error;
    if (error > 0) return -1;
    return real(fd, bytes, error < 0 && length > 1 ? length / 2 : length);
}

ssize_t pread64(int fd, void *bytes, size_t length, off64_t offset) {
    ssize_t (*real)(int, void *, size_t, off64_t) = next("pread64");
    int error = read_fault_of(fd);
    if (error > 0) errno = error;
    if (error > 0) return -1;
    return real(fd, bytes, error < 0 && length > 1 ? length / 2 : length, offset);
}

struct dirent64 *readdir64(DIR *stream) {
    struct dirent64 *(*real)(DIR *) = next("readdir64");
    /* The system does not interrupt a listing. */
    int error = strcmp(kind, "eio") ? 0 : read_fault_of(dirfd(stream));
    if (error > 0) errno = error;
    return error > 0 ? NULL : real(stream);
}

void *__libc_malloc(size_t);
void *__libc_calloc(size_t, size_t);
void *__libc_realloc(void *, size_t);
void *__libc_memalign(size_t, size_t);

/* Whether an allocation of so many bytes fails. */
static int refuses(size_t size) { return size >= LARGE && locked_fault('m') > 0; }

void *malloc(size_t size) { return refuses(size) ? NULL : __libc_malloc(size); }

void *calloc(size_t count, size_t size) {
    return refuses(count * size) ? NULL : __libc_calloc(count, size);
}

void *realloc(void *old, size_t size) { return refuses(size) ? NULL : __libc_realloc(old, size); }

int posix_memalign(void **to, size_t alignment, size_t size) {
    if (refuses(size)) return ENOMEM;
    *to = __libc_memalign(alignment, size);
    return *to ? 0 : ENOMEM;
}

void *aligned_alloc(size_t alignment, size_t size) {
    return refuses(size) ? NULL : __libc_memalign(alignment, size);
}

int open64(const char *path, int flags, ...) {
    va_list list;
    va_start(list, flags);
    mode_t mode = (flags & O_CREAT) ? va_arg(list, mode_t) : 0;
    va_end(list);
    return open_as("open64", path, flags, mode);
}

int open(const char *path, int flags, ...) {
    va_list list;
    va_start(list, flags);
    mode_t mode = (flags & O_CREAT) ? va_arg(list, mode_t) : 0;
    va_end(list);
    return open_as("open", path, flags, mode);
}

ssize_t write(int fd, const void *bytes, size_t length) {
    ssize_t (*real)(int, const void *, size_t) = next("write");
    if (side != 'w' || !is_regular(fd)) return real(fd, bytes, length);
    int error = locked_fault('w');
    if (error > 0) return -1;
    pthread_mutex_lock(&guard);
    find(fd, 1);
    pthread_mutex_unlock(&guard);
    if (error < 0 && length > 1) length /= 2;
    return real(fd, bytes, length);
}

int fchmod(int fd, mode_t mode) {
    int (*real)(int, mode_t) = next("fchmod");
    return locked_fault('w') > 0 ? -1 : real(fd, mode);
}

static int sync_as(const char *name, int fd) {
    int (*real)(int) = next(name);
    if (locked_fault('w') > 0) return -1;
    int done = real(fd);
    if (side != 'w') return done;
    pthread_mutex_lock(&guard);
    struct stat s;
    if (done == 0 && fstat(fd, &s) == 0) {
        int k = find(fd, 0);
        if (k >= 0) files[k].synced = s.st_size;
        if (S_ISDIR(s.st_mode)) {
            for (int r = 0; r < rename_count; r++)
                if (renames[r].had) unlink(renames[r].before);
            rename_count = 0;
        }
    }
    pthread_mutex_unlock(&guard);
    return done;
}

int fsync(int fd) { return sync_as("fsync", fd); }
int fdatasync(int fd) { return sync_as("fdatasync", fd); }

int rename(const char *from, const char *to) {
    int (*real)(const char *, const char *) = next("rename");
    if (locked_fault('w') > 0) return -1;
    if (side != 'w') return real(from, to);
    pthread_mutex_lock(&guard);
    if (rename_count < MOST && !strcmp(kind, "drop")) {
        snprintf(renames[rename_count].from, sizeof renames[0].from, "%s", from);
        snprintf(renames[rename_count].to, sizeof renames[0].to, "%s", to);
        snprintf(renames[rename_count].before, sizeof renames[0].before, "%s.before-%d", to,
                 rename_count);
        renames[rename_count].had = link(to, renames[rename_count].before) == 0;
        rename_count++;
    }
    int done = real(from, to);
    pthread_mutex_unlock(&guard);
    return done;
}

__attribute__((destructor)) static void end(void) {
    const char *path = getenv("SELVEDGE_FAULT_COUNT");
    if (!path || at > 0) return;
    side = 0;
    FILE *file = fopen(path, "w");
    if (!file) return;
    fprintf(file, "%ld\n", count);
    fclose(file);
}
