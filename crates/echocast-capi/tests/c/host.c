/* What belongs to the host stays the host's: its output, signal handlers, floating-point state, threads and memory.
 * argv[1]: a folder for files. */
#define _GNU_SOURCE
#include "check.h"

#include <dirent.h>
#include <fenv.h>
#include <signal.h>
#include <unistd.h>
#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

/* Every allocation of the process is counted. */
extern void *__libc_malloc(size_t);
extern void *__libc_calloc(size_t, size_t);
extern void *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);
static unsigned long allocations;

#if !defined(__SANITIZE_ADDRESS__)
void *malloc(size_t size)
{
    __atomic_add_fetch(&allocations, 1, __ATOMIC_RELAXED);
    return __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
    __atomic_add_fetch(&allocations, 1, __ATOMIC_RELAXED);
    return __libc_calloc(count, size);
}

void *realloc(void *old, size_t size)
{
    __atomic_add_fetch(&allocations, 1, __ATOMIC_RELAXED);
    return __libc_realloc(old, size);
}

int posix_memalign(void **out, size_t alignment, size_t size)
{
    __atomic_add_fetch(&allocations, 1, __ATOMIC_RELAXED);
    *out = __libc_memalign(alignment, size);
    return *out ? 0 : 12;
}
#endif

#define MOST_FRAMES 50

static int threads_now(void)
{
    int count = 0;
    DIR *tasks = opendir("/proc/self/task");
    CHECK(tasks);
    for (struct dirent *entry; (entry = readdir(tasks)) != NULL;)
        count += entry->d_name[0] != '.';
    closedir(tasks);
    return count;
}

/* Bits of the control state, without the flags of what has happened. */
static unsigned fp_control(void)
{
#if defined(__x86_64__)
    return _mm_getcsr() & ~0x3fu;
#else
    return (unsigned)fegetround();
#endif
}

static int ascending(const void *left, const void *right)
{
    unsigned long a = *(const unsigned long *)left, b = *(const unsigned long *)right;
    return (a > b) - (a < b);
}

/* A world of one context: scans `frames` times. Returns the most allocations in a scan, its views and images, without two scans
 * for each thread: its memory is made at its first chunk, and the rest at its first one with returns, in whichever scans
 * these come. */
static unsigned long loop(int threads, int frames, const char *path)
{
    int threads_before = threads_now();
    echocast_context_desc desc = ECHOCAST_CONTEXT_DESC_INIT;
    desc.threads = threads;
    echocast_context *context;
    OK(echocast_context_create(&desc, &context));
    echocast_scene *scene;
    OK(echocast_scene_create(context, NULL, &scene));
    echocast_mesh *mesh = box(context);
    echocast_instance id = place(scene, mesh, at(5, 0, 0), 1);
    echocast_sensor *sensor = around(context);
    echocast_result *result = NULL;
    unsigned long made[MOST_FRAMES];
    CHECK(2 * threads < frames && frames <= MOST_FRAMES);
    for (int frame = 0; frame < frames; ++frame) {
        echocast_pose pose = at(5 + 0.01 * frame, 0, 0);
        OK(echocast_scene_set_poses(scene, 1, &id, &pose));
        echocast_snapshot *snapshot;
        OK(echocast_scene_commit(scene, &snapshot));
        unsigned long before = __atomic_load_n(&allocations, __ATOMIC_RELAXED);
        scan_into(snapshot, sensor,
                  "x,y,z,range,intensity,instance_id,normal_x,normal_y,normal_z,time,beam,red,green,blue", &result);
        CHECK(close_to(least(result, "range"), 4 + 0.01 * frame));
        echocast_image_view image;
        OK(echocast_result_image(result, "depth", &image));
        OK(echocast_result_image(result, "color", &image));
        OK(echocast_result_image(result, "normal", &image));
        made[frame] = __atomic_load_n(&allocations, __ATOMIC_RELAXED) - before;
        echocast_snapshot_release(snapshot);
    }
    OK(echocast_result_write(result, path, NULL));
    /* Failures too say nothing. */
    CHECK(echocast_result_write(result, "/no/such/folder.las", NULL) == ECHOCAST_E_IO);
    if (threads == 1)
        CHECK(threads_now() == threads_before);
    echocast_result_release(result);
    echocast_sensor_release(sensor);
    echocast_mesh_release(mesh);
    echocast_scene_release(scene);
    echocast_context_release(context);
    qsort(made, (size_t)frames, sizeof *made, ascending);
    return made[frames - 1 - 2 * threads];
}

int main(int argc, char **argv)
{
    CHECK(argc == 2);
    char path[600], said[600];
    snprintf(path, sizeof path, "%s/host.csv", argv[1]);
    snprintf(said, sizeof said, "%s/said.txt", argv[1]);

    /* Output: both streams go to a file, which stays empty. */
    fflush(stdout);
    int out = dup(1), err = dup(2);
    CHECK(freopen(said, "w", stderr) && dup2(fileno(stderr), 1) == 1 && dup2(fileno(stderr), 2) == 2);
    struct sigaction before[65];
    for (int number = 1; number < 65; ++number)
        sigaction(number, NULL, &before[number]);

    loop(1, 3, path);

    /* A host that rounds upwards, flushes denormals, and traps what it can, has the same results. */
    unsigned long most_alone = loop(1, 50, path), most_helped = loop(2, 50, path);
    unsigned normal = fp_control();
    CHECK(fesetround(FE_UPWARD) == 0);
#if defined(__x86_64__)
    _mm_setcsr((_mm_getcsr() | 0x8040u) & ~(_MM_MASK_DIV_ZERO | _MM_MASK_INVALID | _MM_MASK_OVERFLOW));
#endif
    unsigned odd = fp_control();
    CHECK(odd != normal);
    echocast_context *context;
    OK(echocast_context_create(NULL, &context));
    CHECK(fp_control() == odd);
    echocast_scene *scene;
    OK(echocast_scene_create(context, NULL, &scene));
    echocast_mesh *mesh = box(context);
    place(scene, mesh, at(5, 0, 0), 1);
    echocast_snapshot *snapshot;
    OK(echocast_scene_commit(scene, &snapshot));
    echocast_sensor *sensor = around(context);
    echocast_result *strange = NULL, *usual = NULL;
    scan_into(snapshot, sensor, "all", &strange);
    CHECK(echocast_result_write(strange, "/no/such/folder.las", NULL) == ECHOCAST_E_IO);
    CHECK(fp_control() == odd);
#if defined(__x86_64__)
    _mm_setcsr(0x1f80);
#endif
    CHECK(fesetround(FE_TONEAREST) == 0);
    scan_into(snapshot, sensor, "all", &usual);
    check_same(strange, usual, NULL);
    echocast_result_release(strange);
    echocast_result_release(usual);
    echocast_sensor_release(sensor);
    echocast_snapshot_release(snapshot);
    echocast_scene_release(scene);
    echocast_mesh_release(mesh);
    echocast_context_release(context);

    for (int number = 1; number < 65; ++number) {
        struct sigaction now;
        if (sigaction(number, NULL, &now) == 0)
            CHECK(now.sa_handler == before[number].sa_handler && now.sa_flags == before[number].sa_flags);
    }
    fflush(stderr);
    CHECK(dup2(out, 1) == 1 && dup2(err, 2) == 2);
    FILE *file = fopen(said, "r");
    CHECK(file);
    int first = fgetc(file);
    fclose(file);
    if (first != EOF) {
        fprintf(stderr, "the library has written to the host's output, see %s\n", said);
        return 1;
    }
    fprintf(stderr, "allocations in a scan: %lu alone, %lu with threads\n", most_alone, most_helped);
    CHECK(most_alone == 0 && most_helped == 0);
    puts("passed");
    return 0;
}
