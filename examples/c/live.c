/* A simulator's loop: makes its own meshes, then for 100 frames moves a car and the sensor, commits, scans at the
 * sensor's rate and reads columns without copying them. Prints how many points there were and a digest of them, the same
 * in every language, and the processor time of a frame.
 *
 *     cc live.c $(pkg-config --cflags --libs echocast) -o live && ./live
 */
#include <echocast.h>

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { FRAMES = 100, HOUSES = 24 };

static void check(echocast_status status)
{
    if (status != ECHOCAST_OK) {
        fprintf(stderr, "error: %s\n", echocast_last_error());
        exit(1);
    }
}

/* A box of 12 triangles from (-x, -y, 0) to (x, y, z). */
static echocast_mesh *box(echocast_context *context, float x, float y, float z, echocast_material *material)
{
    static const uint32_t indices[36] = {0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4,
                                         2, 6, 7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6};
    float corners[8][3];
    for (int i = 0; i < 8; ++i) {
        corners[i][0] = i & 1 ? x : -x;
        corners[i][1] = i & 2 ? y : -y;
        corners[i][2] = i & 4 ? z : 0;
    }
    echocast_part part = ECHOCAST_PART_INIT;
    part.triangle_count = 12;
    part.material = material;
    part.part_id = 1;
    echocast_mesh_desc desc = ECHOCAST_MESH_DESC_INIT;
    desc.positions = corners[0];
    desc.vertex_count = 8;
    desc.indices = indices;
    desc.triangle_count = 12;
    desc.parts = &part;
    desc.part_count = 1;
    echocast_mesh *mesh;
    check(echocast_mesh_create(context, &desc, &mesh));
    return mesh;
}

static echocast_pose at(double x, double y, double z)
{
    echocast_pose pose = ECHOCAST_POSE_IDENTITY;
    pose.m[3] = x;
    pose.m[7] = y;
    pose.m[11] = z;
    return pose;
}

static echocast_instance place(echocast_scene *scene, echocast_mesh *mesh, echocast_pose pose, int fixed,
                               uint32_t category, uint32_t number, const char *name)
{
    echocast_instance_desc desc = ECHOCAST_INSTANCE_DESC_INIT;
    desc.mesh = mesh;
    desc.pose = pose;
    desc.fixed = fixed;
    desc.category_id = category;
    desc.instance_id = number;
    desc.name = name;
    echocast_instance id;
    check(echocast_scene_add(scene, &desc, &id));
    return id;
}

static uint64_t add_to_digest(uint64_t hash, const echocast_result *points, const char *name)
{
    echocast_view column;
    check(echocast_result_view(points, name, &column));
    const unsigned char *bytes = column.data;
    for (size_t k = 0; k < column.count * column.stride; ++k)
        hash = (hash ^ bytes[k]) * UINT64_C(0x100000001b3);
    return hash;
}

int main(void)
{
    echocast_context *context;
    check(echocast_context_create(NULL, &context));
    echocast_material *plaster, *paint;
    check(echocast_material_create(context, "{name: plaster, reflectance: 0.5}", NULL, &plaster));
    check(echocast_material_create(context, "{name: paint, reflectance: 0.75}", NULL, &paint));
    echocast_mesh *ground = box(context, 100, 100, 0.25f, NULL);
    echocast_mesh *house = box(context, 4, 4, 6, plaster);
    echocast_mesh *body = box(context, 2, 1, 1.5f, paint);

    echocast_scene *scene;
    check(echocast_scene_create(context, NULL, &scene));
    check(echocast_scene_name_label(scene, "category", 1, "ground"));
    check(echocast_scene_name_label(scene, "category", 2, "house"));
    check(echocast_scene_name_label(scene, "category", 3, "car"));
    place(scene, ground, at(0, 0, -0.25), 1, 1, 1, "ground");
    for (int i = 0; i < HOUSES; ++i)
        place(scene, house, at(10.0 * (i / 2) - 60, i % 2 ? 12 : -12, 0), 1, 2, 2 + (uint32_t)i, "house");
    echocast_instance car = place(scene, body, at(0, 0, 0), 0, 3, 100, "car");

    echocast_sensor *sensor;
    check(echocast_sensor_create(context, "velodyne_vlp16", &sensor));
    echocast_sensor_info info = ECHOCAST_SENSOR_INFO_INIT;
    check(echocast_sensor_get_info(sensor, &info));

    echocast_result *points = NULL; /* made by the first scan, used again by the others */
    uint64_t hash = UINT64_C(0xcbf29ce484222325);
    size_t total = 0;
    clock_t start = 0;
    for (uint32_t frame = 0; frame < FRAMES; ++frame) {
        if (frame == 1)
            start = clock(); /* the first frame builds what stands */
        /* The car drives ahead, turned by the angle of the triangle 3, 4, 5. */
        echocast_pose pose = {{0.8, -0.6, 0, 8 + 0.25 * frame, 0.6, 0.8, 0, 0.0625 * frame - 3, 0, 0, 1, 0}};
        check(echocast_scene_set_poses(scene, 1, &car, &pose));
        echocast_snapshot *snapshot;
        check(echocast_scene_commit(scene, &snapshot));

        /* The sensor moves during the scan. */
        echocast_pose_key drive[2];
        drive[0].t_ns = frame * info.period_ns;
        drive[0].pose = at(0.125 * frame, 0, 1.75);
        drive[1].t_ns = (frame + 1) * info.period_ns;
        drive[1].pose = at(0.125 * (frame + 1), 0, 1.75);
        echocast_scan_desc scan = ECHOCAST_SCAN_DESC_INIT;
        scan.sensor = sensor;
        scan.poses = drive;
        scan.pose_count = 2;
        scan.t0_ns = drive[0].t_ns;
        scan.seed = 7;
        scan.frame = frame;
        scan.columns = "x,y,z,range,intensity,category_id,instance_id,time";
        check(echocast_scan(snapshot, &scan, &points));
        echocast_snapshot_release(snapshot);

        total += echocast_result_count(points);
        hash = add_to_digest(hash, points, "range");
        hash = add_to_digest(hash, points, "instance_id");
    }
    double milliseconds = 1000.0 * (double)(clock() - start) / CLOCKS_PER_SEC / (FRAMES - 1);
    printf("%d frames: %zu points, digest %016" PRIx64 "\n", FRAMES, total, hash);
    fprintf(stderr, "%.3f ms of processor time a frame\n", milliseconds);

    echocast_result_release(points);
    echocast_sensor_release(sensor);
    echocast_scene_release(scene);
    echocast_mesh_release(ground);
    echocast_mesh_release(house);
    echocast_mesh_release(body);
    echocast_material_release(plaster);
    echocast_material_release(paint);
    echocast_context_release(context);
    return 0;
}
