/* An imaging sonar drives ahead over a bed with a block on it, 20 pings a second; every ping goes into a message as ROS has
 * it: marine_acoustic_msgs/ProjectedSonarImage. Prints a digest of all images, and draws the last ping.
 *
 *     cc -std=c99 ping.c $(pkg-config --cflags --libs echocast) -lm -o ping && ./ping ping.png
 */
#include <echocast.h>

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { PINGS = 20, DTYPE_UINT8 = 0 };

/* What of the message a ping fills. */
struct vector {
    double x, y, z;
};
struct message {
    int64_t stamp_ns;
    float sound_speed;
    struct vector *beam_directions; /* of length 1: z ahead, x up, y to the right */
    float *ranges;                  /* m, the middle of each bin */
    uint32_t dtype, beam_count;
    uint8_t *data; /* a row for each range, in it the beams */
    size_t data_size;
};

static void check(echocast_status status)
{
    if (status != ECHOCAST_OK) {
        fprintf(stderr, "%s: %s\n", echocast_status_string(status), echocast_last_error());
        exit(1);
    }
}

static void *memory(size_t count, size_t size)
{
    void *found = calloc(count, size);
    if (found == NULL)
        exit(1);
    return found;
}

/* What is the same for all pings of a sonar. */
static void prepare(struct message *message, const echocast_ping_info *ping)
{
    message->beam_directions = memory(ping->beams, sizeof *message->beam_directions);
    message->ranges = memory(ping->bins, sizeof *message->ranges);
    message->data_size = (size_t)ping->beams * ping->bins;
    message->data = memory(message->data_size, 1);
    message->dtype = DTYPE_UINT8;
    message->beam_count = ping->beams;
    message->sound_speed = (float)ping->sound_speed;
    for (uint32_t beam = 0; beam < ping->beams; ++beam) {
        /* The frame of the sensor is x ahead, y to the left, z up. */
        double azimuth = ping->axes[2 * beam], elevation = ping->axes[2 * beam + 1];
        message->beam_directions[beam].z = cos(elevation) * cos(azimuth);
        message->beam_directions[beam].y = -cos(elevation) * sin(azimuth);
        message->beam_directions[beam].x = sin(elevation);
    }
    for (uint32_t bin = 0; bin < ping->bins; ++bin)
        message->ranges[bin] = (float)((bin + 0.5) * ping->bin_m);
}

/* A mesh with one triangle after the other. */
static void add(echocast_context *context, echocast_scene *scene, const float *corners, uint32_t triangles, uint32_t number,
                const char *name)
{
    static const uint32_t indices[] = {0, 1, 2, 3, 4, 5};
    echocast_mesh_desc shape = ECHOCAST_MESH_DESC_INIT;
    shape.positions = corners;
    shape.vertex_count = 3 * triangles;
    shape.indices = indices;
    shape.triangle_count = triangles;
    echocast_instance_desc place = ECHOCAST_INSTANCE_DESC_INIT;
    echocast_mesh *mesh;
    check(echocast_mesh_create(context, &shape, &mesh));
    place.mesh = mesh;
    place.fixed = 1;
    place.category_id = number;
    place.instance_id = number;
    place.name = name;
    check(echocast_scene_add(scene, &place, NULL));
    check(echocast_scene_name_label(scene, "category", number, name));
    echocast_mesh_release(mesh);
}

int main(int argc, char **argv)
{
    static const float bed[] = {-50, -50, -8, 50, -50, -8, 50, 50, -8, -50, -50, -8, 50, 50, -8, -50, 50, -8};
    static const float block[] = {9, -1, -8, 9, 1, -8, 9, 1, -6, 9, -1, -8, 9, 1, -6, 9, -1, -6};
    echocast_context *context;
    echocast_scene *scene;
    echocast_snapshot *snapshot;
    echocast_sensor *sonar;
    check(echocast_context_create(NULL, &context));
    check(echocast_scene_create(context, NULL, &scene));
    add(context, scene, bed, 2, 1, "bed");
    add(context, scene, block, 2, 2, "block");
    check(echocast_scene_commit(scene, &snapshot));
    check(echocast_sensor_create(context, "fls_900", &sonar));
    check(echocast_sensor_set(sonar, "range.max_m", "15"));

    echocast_pose_key course[2] = {{0, ECHOCAST_POSE_IDENTITY}, {1000000000, ECHOCAST_POSE_IDENTITY}};
    course[0].pose.m[11] = course[1].pose.m[11] = -6;
    course[1].pose.m[3] = 1; /* 1 m/s ahead */
    echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
    desc.sensor = sonar;
    desc.poses = course;
    desc.pose_count = 2;
    desc.seed = 7;
    desc.columns = "intensity,category_id";
    desc.environment = "{water: {temperature_c: 8}}";

    echocast_pings *pings = NULL; /* made by the first ping, used again by the others */
    struct message message = {0};
    uint64_t hash = UINT64_C(0xcbf29ce484222325);
    size_t on_block = 0;
    clock_t start = 0;
    for (uint32_t frame = 0; frame < PINGS; ++frame) {
        if (frame == 1)
            start = clock(); /* the first ping makes the memory */
        desc.frame = frame;
        desc.t0_ns = 50000000 * (int64_t)frame;
        check(echocast_ping(snapshot, &desc, &pings));
        echocast_ping_info ping = ECHOCAST_PING_INFO_INIT;
        check(echocast_pings_get_info(pings, 0, &ping));
        if (frame == 0)
            prepare(&message, &ping);
        message.stamp_ns = ping.t_ns;
        /* 0 at the level of the noise, 255 from 60 dB above it on. */
        const echocast_pack_item grey = {"intensity", ECHOCAST_TYPE_U8, 0, ping.noise_db, 255 / 60.0};
        check(echocast_pings_pack(pings, 0, &grey, 1, 1, message.data, message.data_size, NULL));

        for (size_t i = 0; i < message.data_size; ++i)
            hash = (hash ^ message.data[i]) * UINT64_C(0x100000001b3);
        echocast_view category; /* where it is: all bins of a beam one after the other */
        check(echocast_pings_view(pings, 0, "category_id", &category));
        for (size_t cell = 0; cell < category.count; ++cell)
            on_block += ((const uint32_t *)category.data)[cell] == 2;
    }
    double milliseconds = 1000.0 * (double)(clock() - start) / CLOCKS_PER_SEC / (PINGS - 1);
    printf("%d pings of %zu cells, %zu of them on the block, digest %016" PRIx64 "\n", PINGS, message.data_size, on_block,
           hash);
    fprintf(stderr, "%.3f ms of processor time a ping\n", milliseconds);
    check(echocast_pings_preview(pings, argc > 1 ? argv[1] : "ping.png", "{view: fan, color: intensity}"));

    free(message.beam_directions);
    free(message.ranges);
    free(message.data);
    echocast_pings_release(pings);
    echocast_sensor_release(sonar);
    echocast_snapshot_release(snapshot);
    echocast_scene_release(scene);
    echocast_context_release(context);
    return 0;
}
