/* Threads scan one snapshot while another one edits the scene and commits: the results are those of one thread, bit by
 * bit. argv[1] is not used. */
#define _POSIX_C_SOURCE 200809L
#include "check.h"

#include <pthread.h>
#include <sched.h>

enum { SCANNERS = 64, ROUNDS = 8, BOXES = 20 };

static echocast_context *context;
static echocast_scene *scene;
static echocast_mesh *mesh;
static echocast_instance ids[BOXES];
static echocast_snapshot *snapshot;
static echocast_sensor *sensor;
static echocast_result *expected;
static volatile int done;

static void *scanner(void *unused)
{
    (void)unused;
    echocast_result *result = NULL;
    for (int round = 0; round < ROUNDS; ++round) {
        /* Another thread may be changing the sensor. */
        echocast_status status;
        while ((status = try_scan_into(snapshot, sensor, "all", &result)) == ECHOCAST_E_BUSY)
            sched_yield();
        OK(status);
        check_same(result, expected, NULL);
        /* A scan of another thread's result, or a change of the sensor, is refused, not undertaken. */
        status = echocast_sensor_set(sensor, "range.max_m", "100");
        CHECK(status == ECHOCAST_OK || status == ECHOCAST_E_BUSY);
        if (round % 8 == 0) {
            echocast_result_release(result);
            result = NULL;
        }
    }
    echocast_result_release(result);
    return unused;
}

static void *editor(void *unused)
{
    unsigned turn = 0;
    echocast_result *result = NULL;
    echocast_sensor *own = around(context);
    while (!done) {
        ++turn;
        echocast_pose poses[BOXES];
        for (int i = 0; i < BOXES; ++i)
            poses[i] = at(4 + turn % 7, i - 10, 0);
        OK(echocast_scene_set_poses(scene, BOXES, ids, poses));
        OK(echocast_scene_remove(scene, ids[turn % BOXES]));
        ids[turn % BOXES] = place(scene, mesh, at(3, 3, 0), turn);
        echocast_snapshot *next;
        OK(echocast_scene_commit(scene, &next));
        scan_into(next, own, NULL, &result);
        CHECK(echocast_result_count(result) > 100);
        echocast_snapshot_release(next);
    }
    echocast_result_release(result);
    echocast_sensor_release(own);
    return unused;
}

int main(int argc, char **argv)
{
    (void)argc;
    (void)argv;
    echocast_context_desc desc = ECHOCAST_CONTEXT_DESC_INIT;
    desc.threads = 3;
    OK(echocast_context_create(&desc, &context));
    OK(echocast_scene_create(context, NULL, &scene));
    mesh = box(context);
    for (int i = 0; i < BOXES; ++i)
        ids[i] = place(scene, mesh, at(6, 3 * i - 30, 0), (uint32_t)i + 1);
    OK(echocast_scene_commit(scene, &snapshot));
    sensor = around(context);
    OK(echocast_sensor_set(sensor, "range.max_m", "100"));
    OK(echocast_sensor_set(sensor, "noise.range_sigma_m", "0.01"));
    scan_into(snapshot, sensor, "all", &expected);
    CHECK(echocast_result_count(expected) > 100);

    pthread_t scanners[SCANNERS], ninth;
    for (int i = 0; i < SCANNERS; ++i)
        CHECK(pthread_create(&scanners[i], NULL, scanner, NULL) == 0);
    CHECK(pthread_create(&ninth, NULL, editor, NULL) == 0);
    for (int i = 0; i < SCANNERS; ++i)
        CHECK(pthread_join(scanners[i], NULL) == 0);
    done = 1;
    CHECK(pthread_join(ninth, NULL) == 0);

    echocast_result_release(expected);
    echocast_sensor_release(sensor);
    echocast_snapshot_release(snapshot);
    echocast_mesh_release(mesh);
    echocast_scene_release(scene);
    echocast_context_release(context);
    puts("passed");
    return 0;
}
