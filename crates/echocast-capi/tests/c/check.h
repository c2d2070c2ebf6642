/* What the test programs share: calls that must succeed, calls that must fail and say why, and a small world. */
#ifndef CHECK_H
#define CHECK_H

#include <echocast.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CHECK(condition)                                                                                               \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition);                                            \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

#define OK(call)                                                                                                       \
    do {                                                                                                               \
        echocast_status status_ = (call);                                                                              \
        if (status_ != ECHOCAST_OK) {                                                                                  \
            fprintf(stderr, "%s:%d: %s: %d %s\n", __FILE__, __LINE__, #call, (int)status_, echocast_last_error());     \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

/* The call fails with `expected`, and the sentence begins with `text`. */
#define FAILS(expected, text, call)                                                                                    \
    do {                                                                                                               \
        echocast_status status_ = (call);                                                                              \
        if (status_ != (expected) || strncmp(echocast_last_error(), text, strlen(text)) != 0) {                        \
            fprintf(stderr, "%s:%d: %s: %d %s\n", __FILE__, __LINE__, #call, (int)status_, echocast_last_error());     \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

static inline echocast_pose at(double x, double y, double z)
{
    echocast_pose pose = ECHOCAST_POSE_IDENTITY;
    pose.m[3] = x;
    pose.m[7] = y;
    pose.m[11] = z;
    return pose;
}

/* A box of 12 triangles, 2 m a side, around the origin. */
static const float BOX_POSITIONS[24] = {-1, -1, -1, 1, -1, -1, -1, 1, -1, 1, 1, -1,
                                        -1, -1, 1,  1, -1, 1,  -1, 1, 1,  1, 1, 1};
static const uint32_t BOX_INDICES[36] = {0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4,
                                         2, 6, 7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6};

static inline echocast_mesh_desc box_desc(void)
{
    echocast_mesh_desc desc = ECHOCAST_MESH_DESC_INIT;
    desc.positions = BOX_POSITIONS;
    desc.vertex_count = 8;
    desc.indices = BOX_INDICES;
    desc.triangle_count = 12;
    return desc;
}

static inline echocast_mesh *box(echocast_context *context)
{
    echocast_mesh_desc desc = box_desc();
    echocast_mesh *mesh;
    OK(echocast_mesh_create(context, &desc, &mesh));
    return mesh;
}

static inline echocast_instance place(echocast_scene *scene, echocast_mesh *mesh, echocast_pose pose, uint32_t number)
{
    echocast_instance_desc desc = ECHOCAST_INSTANCE_DESC_INIT;
    desc.mesh = mesh;
    desc.pose = pose;
    desc.category_id = 3;
    desc.instance_id = number;
    desc.name = "box";
    echocast_instance id;
    OK(echocast_scene_add(scene, &desc, &id));
    return id;
}

/* An ideal sensor with a beam in every degree around and 11 up and down. */
static const char SENSOR_YAML[] =
    "{name: around, kind: lidar, pattern: {type: raster, azimuth: {fov_deg: 360, step_deg: 1}, elevation: {fov_deg: 20, "
    "step_deg: 2}}}";

static inline echocast_sensor *around(echocast_context *context)
{
    echocast_sensor *sensor;
    OK(echocast_sensor_from_text(context, SENSOR_YAML, NULL, &sensor));
    return sensor;
}

/* Scans from the origin. */
static inline echocast_status try_scan_into(const echocast_snapshot *snapshot, const echocast_sensor *sensor,
                                            const char *columns, echocast_result **result)
{
    echocast_pose_key here = {0, ECHOCAST_POSE_IDENTITY};
    echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
    desc.sensor = sensor;
    desc.poses = &here;
    desc.pose_count = 1;
    desc.columns = columns;
    return echocast_scan(snapshot, &desc, result);
}

static inline void scan_into(const echocast_snapshot *snapshot, const echocast_sensor *sensor, const char *columns,
                             echocast_result **result)
{
    OK(try_scan_into(snapshot, sensor, columns, result));
}

/* Scans a scene of this mesh alone, which it releases, around the origin. */
static inline void scan_around(echocast_context *context, echocast_mesh *mesh, echocast_pose pose)
{
    echocast_scene *scene;
    echocast_snapshot *snapshot;
    echocast_result *result = NULL;
    OK(echocast_scene_create(context, NULL, &scene));
    place(scene, mesh, pose, 1);
    OK(echocast_scene_commit(scene, &snapshot));
    echocast_sensor *sensor = around(context);
    scan_into(snapshot, sensor, NULL, &result);
    CHECK(echocast_result_count(result) > 100);
    echocast_result_release(result);
    echocast_sensor_release(sensor);
    echocast_snapshot_release(snapshot);
    echocast_mesh_release(mesh);
    echocast_scene_release(scene);
}

static inline echocast_view view(const echocast_result *result, const char *column)
{
    echocast_view found;
    OK(echocast_result_view(result, column, &found));
    return found;
}

/* Least value of a column of 32-bit floats; infinite without any. */
static inline float least(const echocast_result *result, const char *column)
{
    echocast_view found = view(result, column);
    CHECK(found.kind == ECHOCAST_TYPE_F32);
    const float *values = found.data;
    float low = INFINITY;
    for (size_t i = 0; i < found.count; ++i)
        low = values[i] < low ? values[i] : low;
    return low;
}

/* Two results have the same columns, bit by bit; that called `but` (may be NULL) may differ. */
static inline void check_same(const echocast_result *a, const echocast_result *b, const char *but)
{
    CHECK(echocast_result_count(a) == echocast_result_count(b));
    const char *name;
    for (size_t i = 0; (name = echocast_name("columns", i)) != NULL; ++i) {
        echocast_view one = view(a, name), two = view(b, name);
        CHECK(one.kind == two.kind && one.count == two.count);
        if (but == NULL || strcmp(name, but) != 0)
            CHECK(memcmp(one.data, two.data, one.count * one.stride) == 0);
    }
}

static inline int close_to(double found, double expected)
{
    return fabs(found - expected) < 1e-3;
}

#endif
