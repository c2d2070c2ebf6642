/* Makes all samples of a scenario and writes what is in them, for a test that compares it with what Rust makes.
 * argv: a folder for files, the scenario, the threads of the context: with 1, samples are made side by side. */
#define _POSIX_C_SOURCE 200809L
#include "check.h"

#include <pthread.h>

enum { MAKERS = 4 };

static const char *folder;
static echocast_scenario *scenario;
static uint64_t samples;
static size_t makers;

static void write_bytes(FILE *file, const void *bytes, size_t count)
{
    CHECK(count == 0 || fwrite(bytes, 1, count, file) == count);
}

static FILE *create(const char *path)
{
    FILE *file = fopen(path, "wb");
    CHECK(file != NULL);
    return file;
}

/* What was drawn to NUMBER.json, and of each frame the columns to NUMBER_NAME_FRAME.columns and a LAS file. */
static void write_sample(echocast_sample *sample, uint64_t number, echocast_result **result)
{
    char path[600], name[64];
    static const char all[] = "%s/%u_%s_%u.%s";
    size_t needed, scans;
    OK(echocast_sample_drawn(sample, NULL, 0, &needed));
    char *json = malloc(needed);
    CHECK(json != NULL);
    OK(echocast_sample_drawn(sample, json, needed, NULL));
    snprintf(path, sizeof path, "%s/%u.json", folder, (unsigned)number);
    FILE *file = create(path);
    write_bytes(file, json, needed - 1);
    CHECK(fclose(file) == 0);
    free(json);

    OK(echocast_sample_scans(sample, &scans));
    for (size_t scan = 0; scan < scans; ++scan) {
        echocast_scan_info info = ECHOCAST_SCAN_INFO_INIT;
        info.name = name;
        info.name_capacity = sizeof name;
        OK(echocast_sample_get_scan(sample, scan, &info));
        /* The order does not matter. */
        for (size_t frame = info.frames; frame-- > 0;) {
            OK(echocast_sample_scan(sample, scan, frame, NULL, result));
            snprintf(path, sizeof path, all, folder, (unsigned)number, name, (unsigned)frame, "columns");
            file = create(path);
            const char *column;
            for (size_t i = 0; (column = echocast_name("columns", i)) != NULL; ++i) {
                echocast_view found;
                if (echocast_result_view(*result, column, &found) == ECHOCAST_OK)
                    write_bytes(file, found.data, found.count * found.stride);
            }
            CHECK(fclose(file) == 0);
            snprintf(path, sizeof path, all, folder, (unsigned)number, name, (unsigned)frame, "las");
            OK(echocast_result_write(*result, path, NULL));
        }
    }
}

/* Every so manyth sample from `*first`. */
static void *maker(void *first)
{
    echocast_result *result = NULL;
    for (uint64_t number = *(size_t *)first; number < samples; number += makers) {
        echocast_sample *sample;
        OK(echocast_scenario_sample(scenario, number, &sample));
        write_sample(sample, number, &result);
        echocast_sample_release(sample);
    }
    echocast_result_release(result);
    return NULL;
}

int main(int argc, char **argv)
{
    CHECK(argc == 4);
    folder = argv[1];
    echocast_context_desc desc = ECHOCAST_CONTEXT_DESC_INIT;
    desc.threads = atoi(argv[3]);
    makers = desc.threads == 1 ? MAKERS : 1;
    echocast_context *context;
    OK(echocast_context_create(&desc, &context));
    OK(echocast_scenario_load(context, argv[2], &scenario));
    OK(echocast_scenario_samples(scenario, &samples));
    pthread_t threads[MAKERS];
    size_t firsts[MAKERS];
    for (size_t i = 0; i < makers; ++i) {
        firsts[i] = i;
        CHECK(pthread_create(&threads[i], NULL, maker, &firsts[i]) == 0);
    }
    for (size_t i = 0; i < makers; ++i)
        CHECK(pthread_join(threads[i], NULL) == 0);
    echocast_scenario_release(scenario);
    echocast_context_release(context);
    puts("passed");
    return 0;
}
