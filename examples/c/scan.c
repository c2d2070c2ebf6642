/* Loads the hall, scans it with a Velodyne VLP-16, writes a LAS file, and prints how many points there are and a digest
 * of them, the same in every language.
 *
 *     cc scan.c $(pkg-config --cflags --libs echocast) -o scan && ./scan ../scenes/indoor-1.glb hall.las
 */
#include <echocast.h>

#include <inttypes.h>
#include <stdio.h>

/* 64-bit FNV-1a of the bytes of all columns, one after the other in the order of the table of columns. */
static uint64_t digest(const echocast_result *points)
{
    uint64_t hash = UINT64_C(0xcbf29ce484222325);
    const char *name;
    for (size_t i = 0; (name = echocast_name("columns", i)) != NULL; ++i) {
        echocast_view column;
        if (echocast_result_view(points, name, &column) != ECHOCAST_OK)
            continue; /* not computed */
        const unsigned char *bytes = column.data;
        for (size_t k = 0; k < column.count * column.stride; ++k)
            hash = (hash ^ bytes[k]) * UINT64_C(0x100000001b3);
    }
    return hash;
}

int main(int argc, char **argv)
{
    const char *scene_path = argc > 1 ? argv[1] : "examples/scenes/indoor-1.glb";
    const char *path = argc > 2 ? argv[2] : "hall.las";

    echocast_context *context = NULL;
    echocast_scene *scene = NULL;
    echocast_snapshot *snapshot = NULL;
    echocast_sensor *sensor = NULL;
    echocast_result *points = NULL;

    echocast_pose_key here = {0, ECHOCAST_POSE_IDENTITY};
    here.pose.m[3] = -6.0;
    here.pose.m[7] = 6.0;
    here.pose.m[11] = 1.2;
    echocast_scan_desc scan = ECHOCAST_SCAN_DESC_INIT;
    scan.poses = &here;
    scan.pose_count = 1;
    scan.seed = 7;

    echocast_status status = echocast_context_create(NULL, &context);
    if (status == ECHOCAST_OK)
        status = echocast_scene_create(context, NULL, &scene);
    if (status == ECHOCAST_OK)
        status = echocast_scene_load(scene, scene_path, NULL);
    if (status == ECHOCAST_OK)
        status = echocast_scene_commit(scene, &snapshot);
    if (status == ECHOCAST_OK)
        status = echocast_sensor_create(context, "velodyne_vlp16", &sensor);
    scan.sensor = sensor;
    if (status == ECHOCAST_OK)
        status = echocast_scan(snapshot, &scan, &points);
    if (status == ECHOCAST_OK)
        status = echocast_result_write(points, path, NULL);

    if (status == ECHOCAST_OK)
        printf("%s: %zu points, digest %016" PRIx64 "\n", path, echocast_result_count(points), digest(points));
    else
        fprintf(stderr, "error: %s\n", echocast_last_error());

    /* NULL is allowed, so that one way out is enough. */
    echocast_result_release(points);
    echocast_sensor_release(sensor);
    echocast_snapshot_release(snapshot);
    echocast_scene_release(scene);
    echocast_context_release(context);
    return status == ECHOCAST_OK ? 0 : 1;
}
