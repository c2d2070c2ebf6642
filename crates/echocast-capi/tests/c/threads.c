/* A system that gives no more threads, as in a container with a limit of processes: a status, or nothing that is missed.
 * Root has no such limit, so root becomes somebody else. argv[1] is not used. */
#define _GNU_SOURCE
#include "check.h"

#include <sys/resource.h>
#include <unistd.h>

/* A user that nobody else is: the limit counts all processes of a user. */
enum { SOMEBODY = 54321 };

static void limit(rlim_t processes)
{
    struct rlimit both;
    CHECK(getrlimit(RLIMIT_NPROC, &both) == 0);
    both.rlim_cur = processes < both.rlim_max ? processes : both.rlim_max;
    CHECK(setrlimit(RLIMIT_NPROC, &both) == 0);
}

/* A hilly ground of 2 * 200 * 200 triangles, which several threads build. */
static echocast_mesh *ground(echocast_context *context)
{
    enum { SIDE = 200 };
    static float positions[3 * (SIDE + 1) * (SIDE + 1)];
    static uint32_t indices[6 * SIDE * SIDE];
    float *position = positions;
    uint32_t *index = indices;
    for (int i = 0; i <= SIDE; ++i)
        for (int j = 0; j <= SIDE; ++j) {
            *position++ = (float)(i - SIDE / 2);
            *position++ = (float)(j - SIDE / 2);
            *position++ = -2 + sinf(0.1f * (float)i) * cosf(0.2f * (float)j);
        }
    for (uint32_t i = 0; i < SIDE; ++i)
        for (uint32_t j = 0; j < SIDE; ++j) {
            uint32_t a = i * (SIDE + 1) + j, b = a + SIDE + 1;
            const uint32_t two[6] = {a, b, a + 1, b, b + 1, a + 1};
            memcpy(index, two, sizeof two);
            index += 6;
        }
    echocast_mesh_desc desc = ECHOCAST_MESH_DESC_INIT;
    desc.positions = positions;
    desc.vertex_count = (SIDE + 1) * (SIDE + 1);
    desc.indices = indices;
    desc.triangle_count = 2 * SIDE * SIDE;
    echocast_mesh *mesh;
    OK(echocast_mesh_create(context, &desc, &mesh));
    return mesh;
}

/* Builds and scans a scene that is large enough to be shared by threads. */
static void use(echocast_context *context)
{
    scan_around(context, ground(context), at(0, 0, 0));
}

/* Makes and scans a sample whose scene is made by threads too. */
static void use_sample(echocast_context *context)
{
    echocast_scenario *scenario;
    OK(echocast_scenario_from_text(context,
                                   "{scene: {generate: {seabed: {size_m: [20, 20], cell_m: 0.1}}}, "
                                   "sensors: [{sensor: mbes_400}], trajectory: {position_m: [0, 0, -1]}}",
                                   NULL, &scenario));
    echocast_sample *sample;
    OK(echocast_scenario_sample(scenario, 0, &sample));
    echocast_result *result = NULL;
    OK(echocast_sample_scan(sample, 0, 0, NULL, &result));
    CHECK(echocast_result_count(result) > 50);
    echocast_result_release(result);
    echocast_sample_release(sample);
    echocast_scenario_release(scenario);
}

/* The threads that this process has. */
static int threads(void)
{
    char line[128];
    int count = 0;
    FILE *file = fopen("/proc/self/status", "r");
    CHECK(file != NULL);
    while (fgets(line, sizeof line, file))
        if (sscanf(line, "Threads: %d", &count) == 1)
            break;
    fclose(file);
    return count;
}

int main(int argc, char **argv)
{
    (void)argc;
    (void)argv;
    if (geteuid() == 0 && setuid(SOMEBODY) != 0) {
        fprintf(stderr, "skipped: root cannot become somebody else here\n");
        puts("passed");
        return 0;
    }
    echocast_context_desc desc = ECHOCAST_CONTEXT_DESC_INIT;
    echocast_context *context;

    /* No thread: one of several is refused, at any of them; one that does everything itself is not. */
    for (rlim_t processes = 1; processes < 4; ++processes) {
        limit(processes);
        desc.threads = 8;
        context = (echocast_context *)&desc;
        FAILS(ECHOCAST_E_MEMORY, "the system cannot start 8 threads", echocast_context_create(&desc, &context));
        CHECK(context == NULL);
    }
    desc.threads = 1;
    OK(echocast_context_create(&desc, &context));
    use(context);
    use_sample(context);
    CHECK(threads() == 1);
    echocast_context_release(context);

    /* None any more: whoever has threads asks for no other. */
    limit(RLIM_INFINITY);
    desc.threads = 4;
    OK(echocast_context_create(&desc, &context));
    limit(1);
    const int before = threads();
    use(context);
    use_sample(context);
    CHECK(threads() == before);
    echocast_context_release(context);
    puts("passed");
    return 0;
}
