/* Every function with everything wrong that a host can pass by mistake: always a status and a sentence, never a crash.
 * argv[1]: a folder for files. */
#include "check.h"

#define REFUSED(call)                                                                                                  \
    do {                                                                                                               \
        echocast_status status_ = (call);                                                                              \
        if (status_ == ECHOCAST_OK || status_ >= ECHOCAST_E_INTERNAL || strlen(echocast_last_error()) < 10) {          \
            fprintf(stderr, "%s:%d: %s: %d %s\n", __FILE__, __LINE__, #call, (int)status_, echocast_last_error());     \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

/* The call with each bad handle in place of `handle`. */
#define BAD_HANDLES(type, handle, call)                                                                                \
    for (size_t b_ = 0; b_ < sizeof bad / sizeof *bad; ++b_) {                                                         \
        type *handle = (type *)bad[b_];                                                                                \
        REFUSED(call);                                                                                                 \
    }

/* The call with each bad text in place of `text`. */
#define BAD_TEXTS(text, call)                                                                                          \
    for (size_t b_ = 0; b_ < sizeof bad_texts / sizeof *bad_texts; ++b_) {                                             \
        const char *text = bad_texts[b_];                                                                              \
        REFUSED(call);                                                                                                 \
    }

static int somewhere[64];
static void *bad[] = {NULL, (void *)1, (void *)(intptr_t)-1, somewhere, (void *)0x07ffffff00000000, NULL, NULL};
/* A byte that starts no character, one that is cut off, one that is too long, half of a pair of UTF-16. */
static const char *bad_texts[] = {NULL, "\xff", "caf\xc3", "\xc0\xaf", "\xed\xa0\x80"};
static const double odd[] = {NAN, INFINITY, -INFINITY, 1e300, -1e19};

int main(int argc, char **argv)
{
    CHECK(argc == 2);
    char path[600];
    snprintf(path, sizeof path, "%s/misuse.las", argv[1]);
    echocast_context_desc context_desc = ECHOCAST_CONTEXT_DESC_INIT;
    context_desc.threads = 1;
    echocast_context *context;
    OK(echocast_context_create(&context_desc, &context));
    echocast_mesh *mesh = box(context);
    echocast_material *material;
    OK(echocast_material_create(context, "{name: a}", NULL, &material));
    echocast_scene *scene;
    OK(echocast_scene_create(context, NULL, &scene));
    echocast_instance id = place(scene, mesh, at(4, 0, 0), 1);
    echocast_snapshot *snapshot;
    OK(echocast_scene_commit(scene, &snapshot));
    echocast_sensor *sensor = around(context);
    echocast_result *result = NULL;
    scan_into(snapshot, sensor, NULL, &result);
    char scene_path[600];
    snprintf(scene_path, sizeof scene_path, "%s/wall.obj", argv[1]);
    FILE *wall = fopen(scene_path, "wb");
    CHECK(wall && fputs("v 5 -9 -9\nv 5 9 -9\nv 5 0 9\nf 1 2 3\n", wall) >= 0 && fclose(wall) == 0);
    static const char scenario_yaml[] = "{scene: {files: wall.obj}, sensors: [{sensor: velodyne_vlp16}], "
                                        "trajectory: {position_m: [0, 0, 0]}}";
    echocast_scenario *scenario;
    OK(echocast_scenario_from_text(context, scenario_yaml, argv[1], &scenario));
    echocast_sample *sample;
    OK(echocast_scenario_sample(scenario, 0, &sample));

    /* One that was released, which no kind takes; and one of a kind that no function below is asked for. */
    echocast_mesh *released = box(context);
    echocast_mesh_release(released);
    bad[5] = released;
    bad[6] = context;

    void *out;
    double number;
    size_t needed;
    echocast_instance found;
    echocast_pose pose = ECHOCAST_POSE_IDENTITY;
    echocast_view column;
    char text[64];

    /* Library. */
    echocast_has_feature("\xff");
    CHECK(echocast_name(NULL, 0) == NULL && echocast_name("\xff", 0) == NULL && echocast_name("presets", SIZE_MAX) == NULL);
    for (int status = -100; status < 200; ++status)
        CHECK(strlen(echocast_status_string(status)) > 0);

    /* Structures: sizes that make no sense or cut a field, from the future, from the past. */
    size_t sizes[] = {0, 1, 7, 9, 11, 4097, SIZE_MAX, SIZE_MAX / 2};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; ++i) {
        echocast_context_desc wrong = ECHOCAST_CONTEXT_DESC_INIT;
        wrong.struct_size = sizes[i];
        REFUSED(echocast_context_create(&wrong, (echocast_context **)&out));
        echocast_mesh_desc mesh_wrong = box_desc();
        mesh_wrong.struct_size = sizes[i];
        REFUSED(echocast_mesh_create(context, &mesh_wrong, (echocast_mesh **)&out));
        echocast_instance_desc instance_wrong = ECHOCAST_INSTANCE_DESC_INIT;
        instance_wrong.struct_size = sizes[i];
        REFUSED(echocast_scene_add(scene, &instance_wrong, &found));
        echocast_scan_desc scan_wrong = ECHOCAST_SCAN_DESC_INIT;
        scan_wrong.struct_size = sizes[i];
        REFUSED(echocast_scan(snapshot, &scan_wrong, &result));
        echocast_image image_wrong = ECHOCAST_IMAGE_INIT;
        image_wrong.struct_size = sizes[i];
        REFUSED(echocast_material_create(context, "{name: a}", &image_wrong, (echocast_material **)&out));
        echocast_result_info result_wrong = ECHOCAST_RESULT_INFO_INIT;
        result_wrong.struct_size = sizes[i];
        REFUSED(echocast_result_get_info(result, &result_wrong));
        echocast_sensor_info sensor_wrong = ECHOCAST_SENSOR_INFO_INIT;
        sensor_wrong.struct_size = sizes[i];
        REFUSED(echocast_sensor_get_info(sensor, &sensor_wrong));
        echocast_instance_info info_wrong = ECHOCAST_INSTANCE_INFO_INIT;
        info_wrong.struct_size = sizes[i];
        REFUSED(echocast_scene_get_instance(scene, id, &info_wrong));
        echocast_scene_desc scene_desc_wrong = ECHOCAST_SCENE_DESC_INIT;
        scene_desc_wrong.struct_size = sizes[i];
        REFUSED(echocast_scene_create(context, &scene_desc_wrong, (echocast_scene **)&out));
        echocast_scene_info scene_wrong = ECHOCAST_SCENE_INFO_INIT;
        scene_wrong.struct_size = sizes[i];
        REFUSED(echocast_scene_get_info(scene, &scene_wrong));
        echocast_scan_info scan_info_wrong = ECHOCAST_SCAN_INFO_INIT;
        scan_info_wrong.struct_size = sizes[i];
        REFUSED(echocast_sample_get_scan(sample, 0, &scan_info_wrong));
        echocast_frame_info frame_wrong = ECHOCAST_FRAME_INFO_INIT;
        frame_wrong.struct_size = sizes[i];
        REFUSED(echocast_sample_get_frame(sample, 0, 0, &frame_wrong));
    }
    struct {
        echocast_context_desc desc;
        uint64_t more[4];
    } future = {ECHOCAST_CONTEXT_DESC_INIT, {0, 0, 0, 0}};
    future.desc.struct_size = sizeof future;
    future.desc.threads = 1;
    echocast_context *newer;
    OK(echocast_context_create(&future.desc, &newer));
    echocast_context_release(newer);
    future.more[3] = 1;
    FAILS(ECHOCAST_E_VERSION, "desc has something set at byte ", echocast_context_create(&future.desc, &newer));
    echocast_context_desc past = ECHOCAST_CONTEXT_DESC_INIT;
    past.struct_size = offsetof(echocast_context_desc, log_level);
    past.threads = 1;
    past.log_level = 1000; /* not part of it then */
    OK(echocast_context_create(&past, &newer));
    echocast_context_release(newer);

    /* Contexts. */
    REFUSED(echocast_context_create(NULL, NULL));
    REFUSED(echocast_context_create(&context_desc, (echocast_context **)((char *)somewhere + 1)));

    /* Materials. */
    BAD_HANDLES(echocast_context, wrong, echocast_material_create(wrong == bad[6] ? NULL : wrong, "{name: a}", NULL, (echocast_material **)&out));
    BAD_TEXTS(yaml, echocast_material_create(context, yaml, NULL, (echocast_material **)&out));
    REFUSED(echocast_material_create(context, "{name: a}", NULL, NULL));
    REFUSED(echocast_material_create(context, "", NULL, (echocast_material **)&out));
    echocast_image image = ECHOCAST_IMAGE_INIT;
    image.width = image.height = 16384;
    REFUSED(echocast_material_create(context, "{name: a}", &image, (echocast_material **)&out));
    image.data = (const uint8_t *)somewhere;
    image.row_stride = SIZE_MAX / 2;
    REFUSED(echocast_material_create(context, "{name: a}", &image, (echocast_material **)&out));

    /* Meshes. */
    echocast_mesh_desc desc = box_desc();
    BAD_HANDLES(echocast_context, wrong, echocast_mesh_create(wrong == bad[6] ? NULL : wrong, &desc, (echocast_mesh **)&out));
    REFUSED(echocast_mesh_create(context, NULL, (echocast_mesh **)&out));
    REFUSED(echocast_mesh_create(context, (echocast_mesh_desc *)((char *)somewhere + 4), (echocast_mesh **)&out));
    REFUSED(echocast_mesh_create(context, &desc, NULL));
    for (int field = 0; field < 12; ++field) {
        echocast_mesh_desc wrong = box_desc();
        switch (field) {
        case 0: wrong.positions = NULL; break;
        case 1: wrong.positions = (const float *)((const char *)BOX_POSITIONS + 1); break;
        case 2: wrong.position_stride = 1; break;
        case 3: wrong.position_stride = SIZE_MAX; break;
        case 4: wrong.vertex_count = 0; break;
        case 5: wrong.vertex_count = UINT32_MAX; break;
        case 6: wrong.triangle_count = UINT32_MAX; break;
        case 7: wrong.indices = NULL; break;
        case 8: wrong.indices = (const uint32_t *)((const char *)BOX_INDICES + 2); break;
        case 9: wrong.part_count = 1; break;
        case 10: wrong.name = "\xff"; break;
        default: wrong.ownership = -1; break;
        }
        REFUSED(echocast_mesh_create(context, &wrong, (echocast_mesh **)&out));
        CHECK(out == NULL);
    }
    for (size_t i = 0; i < sizeof odd / sizeof *odd; ++i) {
        float positions[24];
        memcpy(positions, BOX_POSITIONS, sizeof positions);
        positions[i] = (float)odd[i];
        echocast_mesh_desc wrong = box_desc();
        wrong.positions = positions;
        REFUSED(echocast_mesh_create(context, &wrong, (echocast_mesh **)&out));
    }
    echocast_part part = ECHOCAST_PART_INIT;
    desc.parts = &part;
    desc.part_count = 1;
    for (size_t b = 1; b < sizeof bad / sizeof *bad; ++b) {
        part.triangle_count = 12;
        part.material = (echocast_material *)bad[b];
        REFUSED(echocast_mesh_create(context, &desc, (echocast_mesh **)&out));
    }
    BAD_HANDLES(echocast_mesh, wrong, echocast_mesh_prepare(wrong));

    /* Scenes. */
    double origin[3] = {0, 0, 0};
    echocast_scene_desc scene_desc = ECHOCAST_SCENE_DESC_INIT;
    scene_desc.origin = origin;
    BAD_HANDLES(echocast_context, wrong, echocast_scene_create(wrong == bad[6] ? NULL : wrong, &scene_desc, (echocast_scene **)&out));
    scene_desc.origin = (const double *)((char *)somewhere + 1);
    REFUSED(echocast_scene_create(context, &scene_desc, (echocast_scene **)&out));
    scene_desc.origin = origin;
    REFUSED(echocast_scene_create(context, &scene_desc, NULL));
    for (size_t i = 0; i < sizeof odd / sizeof *odd; ++i) {
        origin[1] = odd[i];
        REFUSED(echocast_scene_create(context, &scene_desc, (echocast_scene **)&out));
    }
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_load(wrong, "a.obj", NULL));
    BAD_TEXTS(name, echocast_scene_load(scene, name, NULL));
    REFUSED(echocast_scene_load(scene, "", NULL));
    REFUSED(echocast_scene_load(scene, "a.obj", "\xff"));
    REFUSED(echocast_scene_load(scene, "a.obj", "{scale: 0}"));
    REFUSED(echocast_scene_load(scene, argv[1], NULL));
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_load_memory(wrong, "glTF", 4, NULL));
    REFUSED(echocast_scene_load_memory(scene, NULL, 4, NULL));
    REFUSED(echocast_scene_load_memory(scene, NULL, 0, NULL));
    REFUSED(echocast_scene_load_memory(scene, somewhere, SIZE_MAX, NULL));
    REFUSED(echocast_scene_load_memory(scene, somewhere, sizeof somewhere, NULL));
    echocast_instance_desc instance = ECHOCAST_INSTANCE_DESC_INIT;
    REFUSED(echocast_scene_add(scene, &instance, &found));
    REFUSED(echocast_scene_add(scene, NULL, &found));
    for (size_t b = 0; b < sizeof bad / sizeof *bad; ++b) {
        instance.mesh = (echocast_mesh *)bad[b];
        REFUSED(echocast_scene_add(scene, &instance, &found));
    }
    instance.mesh = mesh;
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_add(wrong, &instance, &found));
    REFUSED(echocast_scene_add(scene, &instance, (echocast_instance *)((char *)somewhere + 1)));
    for (size_t b = 1; b < sizeof bad / sizeof *bad; ++b) {
        instance.material = (echocast_material *)bad[b];
        REFUSED(echocast_scene_add(scene, &instance, &found));
    }
    instance.material = NULL;
    instance.name = "\xff";
    REFUSED(echocast_scene_add(scene, &instance, &found));
    instance.name = NULL;
    for (size_t i = 0; i < sizeof odd / sizeof *odd; ++i) {
        for (int entry = 0; entry < 12; ++entry) {
            instance.pose = pose;
            instance.pose.m[entry] = odd[i];
            REFUSED(echocast_scene_add(scene, &instance, &found));
            CHECK(found == 0);
            REFUSED(echocast_scene_set_poses(scene, 1, &id, &instance.pose));
        }
    }
    echocast_instance strange[] = {0, 1, UINT64_MAX, id ^ 1, id + ((uint64_t)1 << 32)};
    for (size_t i = 0; i < sizeof strange / sizeof *strange; ++i) {
        REFUSED(echocast_scene_remove(scene, strange[i]));
        REFUSED(echocast_scene_set_poses(scene, 1, &strange[i], &pose));
        REFUSED(echocast_scene_set_vertices(scene, strange[i], BOX_POSITIONS, NULL, 8));
        REFUSED(echocast_scene_set_labels(scene, strange[i], 1, 1, NULL, 0));
        REFUSED(echocast_scene_set_mask(scene, strange[i], 1));
        REFUSED(echocast_scene_set_material(scene, strange[i], NULL));
    }
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_remove(wrong, id));
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_find(wrong, "box", &found));
    BAD_TEXTS(name, echocast_scene_find(scene, name, &found));
    REFUSED(echocast_scene_find(scene, "box", NULL));
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_camera(wrong, "box", &pose));
    BAD_TEXTS(name, echocast_scene_camera(scene, name, &pose));
    REFUSED(echocast_scene_camera(scene, "box", NULL));
    char camera_name[8];
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_get_camera(wrong, 0, camera_name, 8, NULL, &pose));
    REFUSED(echocast_scene_get_camera(scene, 0, camera_name, 8, NULL, &pose));
    REFUSED(echocast_scene_get_camera(scene, SIZE_MAX, NULL, 0, NULL, NULL));
    uint32_t label;
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_label_number(wrong, "category", "box", &label));
    BAD_TEXTS(name, echocast_scene_label_number(scene, name, "box", &label));
    BAD_TEXTS(name, echocast_scene_label_number(scene, "category", name, &label));
    REFUSED(echocast_scene_label_number(scene, "category", "box", NULL));
    const double spot[3] = {0, 0, 0}, upright[4] = {0, 0, 0, 1};
    REFUSED(echocast_pose_from_quaternion(NULL, upright, &pose));
    REFUSED(echocast_pose_from_quaternion(spot, NULL, &pose));
    REFUSED(echocast_pose_from_quaternion(spot, upright, NULL));
    for (size_t i = 0; i < sizeof odd / sizeof *odd; ++i) {
        const double far_off[3] = {0, odd[i], 0}, turned[4] = {0, odd[i], 0, 1}, none[4] = {0, 0, 0, 0};
        if (!(fabs(odd[i]) < INFINITY))
            REFUSED(echocast_pose_from_quaternion(far_off, upright, &pose));
        REFUSED(echocast_pose_from_quaternion(spot, turned, &pose));
        REFUSED(echocast_pose_from_quaternion(spot, none, &pose));
    }
    echocast_scene_info scene_info = ECHOCAST_SCENE_INFO_INIT;
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_get_info(wrong, &scene_info));
    REFUSED(echocast_scene_get_info(scene, NULL));
    echocast_instance_info instance_info = ECHOCAST_INSTANCE_INFO_INIT;
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_get_instances(wrong, 0, 1, &found, &needed));
    REFUSED(echocast_scene_get_instances(scene, 0, 1, NULL, &needed));
    REFUSED(echocast_scene_get_instances(scene, 0, SIZE_MAX, &found, &needed));
    REFUSED(echocast_scene_get_instances(scene, 0, 0, NULL, (size_t *)((char *)somewhere + 1)));
    OK(echocast_scene_get_instances(scene, SIZE_MAX, 1, &found, NULL));
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_get_instance(wrong, id, &instance_info));
    REFUSED(echocast_scene_get_instance(scene, id, NULL));
    REFUSED(echocast_scene_get_instance(scene, 0, &instance_info));
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_set_poses(wrong, 1, &id, &pose));
    REFUSED(echocast_scene_set_poses(scene, 1, NULL, &pose));
    REFUSED(echocast_scene_set_poses(scene, 1, &id, NULL));
    REFUSED(echocast_scene_set_poses(scene, SIZE_MAX, &id, &pose));
    REFUSED(echocast_scene_set_poses(scene, SIZE_MAX / 8, &id, &pose));
    OK(echocast_scene_set_poses(scene, 0, NULL, NULL));
    echocast_pose_key keys[2] = {{0, ECHOCAST_POSE_IDENTITY}, {1000, ECHOCAST_POSE_IDENTITY}};
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_set_motion(wrong, id, keys, 2));
    REFUSED(echocast_scene_set_motion(scene, 0, keys, 2));
    REFUSED(echocast_scene_set_motion(scene, id, NULL, 2));
    REFUSED(echocast_scene_set_motion(scene, id, keys, 0));
    REFUSED(echocast_scene_set_motion(scene, id, keys, SIZE_MAX));
    REFUSED(echocast_scene_set_motion(scene, id, keys, SIZE_MAX / sizeof *keys));
    for (size_t i = 0; i < sizeof odd / sizeof *odd; ++i) {
        keys[1].pose.m[3] = odd[i];
        REFUSED(echocast_scene_set_motion(scene, id, keys, 2));
    }
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_set_time(wrong, 0, 0));
    REFUSED(echocast_scene_set_time(scene, 0, -1));
    REFUSED(echocast_scene_set_time(scene, 0, INT64_MIN));
    REFUSED(echocast_scene_set_time(scene, 0, INT64_MAX));
    OK(echocast_scene_set_time(scene, INT64_MIN, 0));
    OK(echocast_scene_set_time(scene, INT64_MAX, 0));
    OK(echocast_scene_set_time(scene, 0, 0));
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_set_vertices(wrong, id, BOX_POSITIONS, NULL, 8));
    REFUSED(echocast_scene_set_vertices(scene, id, NULL, NULL, 8));
    REFUSED(echocast_scene_set_vertices(scene, id, BOX_POSITIONS, NULL, 0));
    REFUSED(echocast_scene_set_vertices(scene, id, BOX_POSITIONS, NULL, SIZE_MAX));
    REFUSED(echocast_scene_set_vertices(scene, id, BOX_POSITIONS, (const float *)((char *)somewhere + 1), 8));
    int64_t times[] = {0, 1};
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_set_vertex_motion(wrong, id, times, 1, BOX_POSITIONS, 8));
    REFUSED(echocast_scene_set_vertex_motion(scene, id, NULL, 1, BOX_POSITIONS, 8));
    REFUSED(echocast_scene_set_vertex_motion(scene, id, times, 0, BOX_POSITIONS, 8));
    REFUSED(echocast_scene_set_vertex_motion(scene, id, times, SIZE_MAX / 8, BOX_POSITIONS, 8));
    REFUSED(echocast_scene_set_vertex_motion(scene, id, times, SIZE_MAX, BOX_POSITIONS, 8));
    REFUSED(echocast_scene_set_vertex_motion(scene, id, times, 1, NULL, 8));
    REFUSED(echocast_scene_set_vertex_motion(scene, id, times, 1, BOX_POSITIONS, SIZE_MAX));
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_set_labels(wrong, id, 1, 1, NULL, 0));
    uint32_t part_id = 1;
    REFUSED(echocast_scene_set_labels(scene, id, 1, 1, &part_id, SIZE_MAX));
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_set_mask(wrong, id, 1));
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_set_material(wrong, id, material));
    for (size_t b = 1; b < sizeof bad / sizeof *bad; ++b)
        REFUSED(echocast_scene_set_material(scene, id, (echocast_material *)bad[b]));
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_name_label(wrong, "part", 1, "a"));
    BAD_TEXTS(name, echocast_scene_name_label(scene, name, 1, "a"));
    BAD_TEXTS(name, echocast_scene_name_label(scene, "part", 1, name));
    REFUSED(echocast_scene_name_label(scene, "part", 0, "a"));
    BAD_HANDLES(echocast_scene, wrong, echocast_scene_commit(wrong, (echocast_snapshot **)&out));
    REFUSED(echocast_scene_commit(scene, NULL));

    /* Sensors. */
    BAD_HANDLES(echocast_context, wrong, echocast_sensor_create(wrong == bad[6] ? NULL : wrong, "kinect_v2", (echocast_sensor **)&out));
    BAD_TEXTS(name, echocast_sensor_create(context, name, (echocast_sensor **)&out));
    REFUSED(echocast_sensor_create(context, "", (echocast_sensor **)&out));
    REFUSED(echocast_sensor_create(context, "kinect_v2", NULL));
    BAD_HANDLES(echocast_context, wrong, echocast_sensor_from_text(wrong == bad[6] ? NULL : wrong, SENSOR_YAML, NULL, (echocast_sensor **)&out));
    BAD_TEXTS(yaml, echocast_sensor_from_text(context, yaml, NULL, (echocast_sensor **)&out));
    REFUSED(echocast_sensor_from_text(context, SENSOR_YAML, NULL, NULL));
    echocast_beam beam = {0, {1, 0, 0}, 0, 0, 0, {0, 0, 0}, 0};
    echocast_beams_desc beams = ECHOCAST_BEAMS_DESC_INIT;
    beams.name = "a";
    beams.beams = &beam;
    beams.rows = beams.columns = 1;
    beams.period_ns = 1000;
    echocast_sensor *made;
    OK(echocast_sensor_from_beams(context, &beams, &made));
    echocast_sensor_release(made);
    BAD_HANDLES(echocast_context, wrong, echocast_sensor_from_beams(wrong == bad[6] ? NULL : wrong, &beams, (echocast_sensor **)&out));
    BAD_TEXTS(name, (beams.name = name, echocast_sensor_from_beams(context, &beams, (echocast_sensor **)&out)));
    REFUSED(echocast_sensor_from_beams(context, NULL, (echocast_sensor **)&out));
    beams.name = "a";
    REFUSED(echocast_sensor_from_beams(context, &beams, NULL));
    for (int field = 0; field < 10; ++field) {
        echocast_beams_desc wrong = beams;
        switch (field) {
        case 0: wrong.name = ""; break;
        case 1: wrong.beams = NULL; break;
        case 2: wrong.rows = 0; break;
        case 3: wrong.rows = wrong.columns = UINT32_MAX; break;
        case 4: wrong.period_ns = 0; break;
        case 5: wrong.period_ns = INT64_MIN; break;
        case 6: wrong.firing = 3; break;
        case 7: wrong.reserved = 1; break;
        case 8: wrong.struct_size = 12; /* half of the name's address */ break;
        default: wrong.beams = (echocast_beam *)((char *)somewhere + 1); break;
        }
        REFUSED(echocast_sensor_from_beams(context, &wrong, (echocast_sensor **)&out));
    }
    for (size_t i = 0; i < sizeof odd / sizeof *odd; ++i) {
        echocast_beam wrong = beam;
        wrong.direction[1] = (float)odd[i];
        beams.beams = &wrong;
        REFUSED(echocast_sensor_from_beams(context, &beams, (echocast_sensor **)&out));
    }
    echocast_beam strange_beams[3] = {beam, beam, beam};
    strange_beams[0].range_max_m = NAN;
    strange_beams[1].channel = 65536;
    strange_beams[2].reserved = 1;
    for (int i = 0; i < 3; ++i) {
        beams.beams = &strange_beams[i];
        REFUSED(echocast_sensor_from_beams(context, &beams, (echocast_sensor **)&out));
    }
    BAD_HANDLES(echocast_sensor, wrong, echocast_sensor_set(wrong, "noise.dropout", "0"));
    BAD_TEXTS(key, echocast_sensor_set(sensor, key, "0"));
    BAD_TEXTS(value, echocast_sensor_set(sensor, "noise.dropout", value));
    REFUSED(echocast_sensor_set(sensor, "", ""));
    static char deep[600001], wide[1000001];
    for (size_t i = 0; i + 1 < sizeof deep; ++i)
        deep[i] = i % 2 ? '.' : 'a';
    REFUSED(echocast_sensor_set(sensor, deep, "1"));
    memset(wide, '7', sizeof wide - 1);
    REFUSED(echocast_sensor_set(sensor, "noise.dropout", wide));
    CHECK(strlen(echocast_last_error()) < 1000);
    REFUSED(echocast_sensor_set(sensor, "noise.dropout", "[[[[[["));
    REFUSED(echocast_sensor_set(sensor, "noise.dropout", ".nan"));
    REFUSED(echocast_sensor_set(sensor, "pattern.azimuth.step_deg", "1e-9"));
    BAD_HANDLES(echocast_sensor, wrong, echocast_sensor_get(wrong, "noise.dropout", &number, NULL, NULL));
    BAD_TEXTS(key, echocast_sensor_get(sensor, key, &number, NULL, NULL));
    REFUSED(echocast_sensor_get(sensor, "name", &number, NULL, NULL));
    REFUSED(echocast_sensor_get(sensor, "noise.dropout", (double *)((char *)somewhere + 1), NULL, NULL));
    BAD_HANDLES(echocast_sensor, wrong, echocast_sensor_describe(wrong, text, sizeof text, &needed));
    REFUSED(echocast_sensor_describe(sensor, NULL, 0, NULL));
    OK(echocast_sensor_describe(sensor, text, 0, NULL));
    echocast_sensor_info sensor_info = ECHOCAST_SENSOR_INFO_INIT;
    BAD_HANDLES(echocast_sensor, wrong, echocast_sensor_get_info(wrong, &sensor_info));
    REFUSED(echocast_sensor_get_info(sensor, NULL));
    BAD_HANDLES(echocast_sensor, wrong, echocast_sensor_get_beams(wrong, 0, 1, &beam));
    REFUSED(echocast_sensor_get_beams(sensor, 0, 1, NULL));
    REFUSED(echocast_sensor_get_beams(sensor, SIZE_MAX, 2, &beam));
    REFUSED(echocast_sensor_get_beams(sensor, 0, SIZE_MAX, &beam));

    /* Scans. */
    echocast_pose_key here = {0, ECHOCAST_POSE_IDENTITY};
    echocast_scan_desc scan = ECHOCAST_SCAN_DESC_INIT;
    scan.sensor = sensor;
    scan.poses = &here;
    scan.pose_count = 1;
    BAD_HANDLES(echocast_snapshot, wrong, echocast_scan(wrong, &scan, &result));
    REFUSED(echocast_scan(snapshot, NULL, &result));
    REFUSED(echocast_scan(snapshot, &scan, NULL));
    for (size_t b = 1; b < sizeof bad / sizeof *bad; ++b) {
        echocast_result *wrong = (echocast_result *)bad[b];
        REFUSED(echocast_scan(snapshot, &scan, &wrong));
        CHECK(wrong == (echocast_result *)bad[b]);
    }
    for (size_t b = 0; b < sizeof bad / sizeof *bad; ++b) {
        scan.sensor = (echocast_sensor *)bad[b];
        REFUSED(echocast_scan(snapshot, &scan, &result));
    }
    scan.sensor = sensor;
    for (int field = 0; field < 14; ++field) {
        echocast_scan_desc wrong = scan;
        switch (field) {
        case 0: wrong.poses = NULL; break;
        case 1: wrong.poses = (echocast_pose_key *)((char *)somewhere + 4); break;
        case 2: wrong.pose_count = SIZE_MAX; break;
        case 3: wrong.mask = 0; break;
        case 4: wrong.columns = "\xff"; break;
        case 5: wrong.columns = ""; break;
        case 6: wrong.organised = 2; break;
        case 7: wrong.coordinates = -1; break;
        case 8: wrong.profile = 99; break;
        case 9: wrong.reflectance = 4; break;
        case 10: wrong.environment = "\xff"; break;
        case 11: wrong.environment = "{rain: {rate_mm_h: -1}}"; break;
        case 12: wrong.environment = "{rain: ["; break;
        default: wrong.reserved = 1; break;
        }
        REFUSED(echocast_scan(snapshot, &wrong, &result));
    }
    for (size_t i = 0; i < sizeof odd / sizeof *odd; ++i) {
        for (int entry = 0; entry < 12; ++entry) {
            if (entry % 4 == 3 && i > 2)
                continue; /* far away, but somewhere */
            here.pose = at(0, 0, 0);
            here.pose.m[entry] = odd[i];
            REFUSED(echocast_scan(snapshot, &scan, &result));
        }
    }
    here.pose = at(0, 0, 0);
    scan.t0_ns = INT64_MIN + 1;
    scan.frame = UINT32_MAX;
    scan.seed = UINT64_MAX;
    OK(echocast_scan(snapshot, &scan, &result));
    CHECK(echocast_result_count(result) > 0);

    /* Results. */
    echocast_result_info result_info = ECHOCAST_RESULT_INFO_INIT;
    BAD_HANDLES(echocast_result, wrong, echocast_result_get_info(wrong, &result_info));
    REFUSED(echocast_result_get_info(result, NULL));
    CHECK(echocast_result_count(NULL) == 0 && echocast_result_count((echocast_result *)somewhere) == 0);
    BAD_HANDLES(echocast_result, wrong, echocast_result_view(wrong, "x", &column));
    BAD_HANDLES(echocast_result, wrong, echocast_result_label_number(wrong, "category", "box", &label));
    BAD_TEXTS(name, echocast_result_label_number(result, "category", name, &label));
    REFUSED(echocast_result_label_number(result, "category", "box", NULL));
    BAD_TEXTS(name, echocast_result_view(result, name, &column));
    REFUSED(echocast_result_view(result, "x", NULL));
    REFUSED(echocast_result_view(result, "x", (echocast_view *)((char *)somewhere + 1)));
    echocast_box_view boxes;
    echocast_image_box_view seen;
    echocast_image_view layer;
    REFUSED(echocast_result_boxes(result, &boxes)); /* a scan without them */
    scan.columns = "all";
    static const int32_t no_axes[] = {INT32_MIN, -1, 3, INT32_MAX};
    for (size_t i = 0; i < sizeof no_axes / sizeof *no_axes; ++i) {
        scan.boxes = no_axes[i];
        REFUSED(echocast_scan(snapshot, &scan, &result));
    }
    scan.boxes = ECHOCAST_BOXES_OBJECT;
    scan.image_boxes = 2;
    REFUSED(echocast_scan(snapshot, &scan, &result));
    scan.image_boxes = 1;
    OK(echocast_scan(snapshot, &scan, &result));
    OK(echocast_result_boxes(result, &boxes));
    CHECK(boxes.count == 1);
    BAD_HANDLES(echocast_result, wrong, echocast_result_boxes(wrong, &boxes));
    CHECK(boxes.count == 0 && boxes.data == NULL);
    REFUSED(echocast_result_boxes(result, NULL));
    REFUSED(echocast_result_boxes(result, (echocast_box_view *)((char *)somewhere + 1)));
    BAD_HANDLES(echocast_result, wrong, echocast_result_image(wrong, "depth", &layer));
    BAD_TEXTS(name, echocast_result_image(result, name, &layer));
    REFUSED(echocast_result_image(result, "", &layer));
    CHECK(layer.data == NULL && layer.width == 0);
    REFUSED(echocast_result_image(result, "depth", NULL));
    REFUSED(echocast_result_image(result, "depth", (echocast_image_view *)((char *)somewhere + 1)));
    BAD_HANDLES(echocast_result, wrong, echocast_result_image_boxes(wrong, &seen));
    REFUSED(echocast_result_image_boxes(result, NULL));
    REFUSED(echocast_result_image_boxes(result, (echocast_image_box_view *)((char *)somewhere + 1)));
    OK(echocast_result_image_boxes(result, &seen));
    CHECK(seen.count == 1);
    BAD_HANDLES(echocast_sample, wrong, echocast_sample_set_boxes(wrong, ECHOCAST_BOXES_OBJECT, 0));
    REFUSED(echocast_sample_set_boxes(sample, 3, 0));
    REFUSED(echocast_sample_set_boxes(sample, INT32_MIN, 0));
    REFUSED(echocast_sample_set_boxes(sample, ECHOCAST_BOXES_OBJECT, -1));
    REFUSED(echocast_sample_set_boxes(sample, ECHOCAST_BOXES_NONE, 1));
    static unsigned char bytes[1 << 16];
    echocast_pack_item item = {"x", ECHOCAST_TYPE_F32, 0, 0, 1};
    BAD_HANDLES(echocast_result, wrong, echocast_result_pack(wrong, &item, 1, 4, bytes, sizeof bytes, NULL));
    REFUSED(echocast_result_pack(result, NULL, 1, 4, bytes, sizeof bytes, NULL));
    REFUSED(echocast_result_pack(result, &item, SIZE_MAX, 4, bytes, sizeof bytes, NULL));
    REFUSED(echocast_result_pack(result, &item, 0, 4, bytes, sizeof bytes, NULL));
    REFUSED(echocast_result_pack(result, &item, 1, 0, bytes, sizeof bytes, NULL));
    REFUSED(echocast_result_pack(result, &item, 1, 3, bytes, sizeof bytes, NULL));
    REFUSED(echocast_result_pack(result, &item, 1, SIZE_MAX, bytes, sizeof bytes, NULL));
    REFUSED(echocast_result_pack(result, &item, 1, 4, NULL, sizeof bytes, NULL));
    REFUSED(echocast_result_pack(result, &item, 1, 4, bytes, 3, NULL));
    item.offset = UINT32_MAX;
    REFUSED(echocast_result_pack(result, &item, 1, 4, bytes, sizeof bytes, NULL));
    item.offset = 0;
    BAD_HANDLES(echocast_result, wrong, echocast_result_pack_driver(wrong, 1, 0, bytes, sizeof bytes, NULL));
    REFUSED(echocast_result_pack_driver(result, 0, 0, bytes, sizeof bytes, NULL));
    REFUSED(echocast_result_pack_driver(result, INT32_MIN, 0, bytes, sizeof bytes, NULL));
    REFUSED(echocast_result_pack_driver(result, INT32_MAX, INT64_MIN, bytes, sizeof bytes, NULL));
    REFUSED(echocast_result_pack_driver(result, 1, INT64_MAX, NULL, SIZE_MAX, NULL));
    REFUSED(echocast_result_pack_driver(result, 1, 0, bytes, 3, NULL));
    BAD_HANDLES(echocast_result, wrong, echocast_result_pack_message(wrong, 1, "laser", bytes, sizeof bytes, NULL));
    BAD_TEXTS(name, echocast_result_pack_message(result, 1, name, bytes, sizeof bytes, NULL));
    REFUSED(echocast_result_pack_message(result, 0, "laser", bytes, sizeof bytes, NULL));
    REFUSED(echocast_result_pack_message(result, INT32_MIN, "laser", bytes, sizeof bytes, NULL));
    REFUSED(echocast_result_pack_message(result, 1, "laser", bytes, sizeof bytes, NULL)); /* of another sensor */
    echocast_pose_key steps[2] = {{0, ECHOCAST_POSE_IDENTITY}, {INT64_MAX, ECHOCAST_POSE_IDENTITY}};
    BAD_TEXTS(name, echocast_pack_imu(steps, 1, 1, 0, 0, name, bytes, sizeof bytes, NULL));
    REFUSED(echocast_pack_imu(NULL, 1, 1, 0, 0, "imu", bytes, sizeof bytes, NULL));
    REFUSED(echocast_pack_imu(steps, SIZE_MAX, 1, 0, 0, "imu", bytes, sizeof bytes, NULL));
    REFUSED(echocast_pack_imu(steps, 1, 0, 0, 0, "imu", bytes, sizeof bytes, NULL));
    REFUSED(echocast_pack_imu(steps, 1, 1, 0, INT64_MAX, "imu", bytes, sizeof bytes, NULL));
    REFUSED(echocast_pack_imu(steps, 1, 1, 0, 0, "imu", bytes, 3, NULL));
    OK(echocast_pack_imu(steps, 2, 1, UINT64_MAX, -1, "imu", bytes, sizeof bytes, NULL));
    BAD_TEXTS(name, echocast_pack_odometry(steps, 2, 0, name, "base_link", bytes, sizeof bytes, NULL));
    BAD_TEXTS(name, echocast_pack_odometry(steps, 2, 0, "odom", name, bytes, sizeof bytes, NULL));
    REFUSED(echocast_pack_odometry(steps, 0, 0, "odom", "base_link", bytes, sizeof bytes, NULL));
    REFUSED(echocast_pack_odometry(steps + 1, 1, INT64_MIN, "odom", "base_link", bytes, sizeof bytes, NULL));
    uint32_t height, width;
    BAD_HANDLES(echocast_result, wrong, echocast_result_driver_shape(wrong, 1, &height, &width));
    REFUSED(echocast_result_driver_shape(result, 0, &height, &width));
    REFUSED(echocast_result_driver_shape(result, 1, NULL, &width));
    REFUSED(echocast_driver_get_info(1, NULL));
    REFUSED(echocast_driver_get_info(-1, NULL));
    BAD_TEXTS(name, (item.column = name, echocast_result_pack(result, &item, 1, 4, bytes, sizeof bytes, NULL)));
    item.column = "x";
    item.kind = INT32_MIN;
    REFUSED(echocast_result_pack(result, &item, 1, 4, bytes, sizeof bytes, NULL));
    CHECK(echocast_result_label_name(NULL, "part", 1) == NULL && echocast_result_label_name(result, NULL, 1) == NULL);
    CHECK(echocast_result_label_name(result, "\xff", 1) == NULL);
    BAD_HANDLES(echocast_result, wrong, echocast_result_append(wrong, result));
    BAD_HANDLES(echocast_result, wrong, echocast_result_append(result, wrong));

    /* Pings: of something that is no sonar, and of a sonar. */
    echocast_pings *pings = NULL;
    REFUSED(echocast_ping(snapshot, &scan, &pings));
    CHECK(pings == NULL);
    echocast_sensor *sonar;
    OK(echocast_sensor_create(context, "sbes_200", &sonar));
    OK(echocast_sensor_set(sonar, "pattern.rays", "64"));
    scan.sensor = sonar;
    scan.boxes = scan.image_boxes = 0;
    here.pose = at(0, 0, -2);
    BAD_HANDLES(echocast_snapshot, wrong, echocast_ping(wrong, &scan, &pings));
    REFUSED(echocast_ping(snapshot, NULL, &pings));
    REFUSED(echocast_ping(snapshot, &scan, NULL));
    REFUSED(echocast_ping(snapshot, &scan, (echocast_pings **)((char *)somewhere + 1)));
    for (size_t b = 1; b < sizeof bad / sizeof *bad; ++b) {
        echocast_pings *wrong = (echocast_pings *)bad[b];
        REFUSED(echocast_ping(snapshot, &scan, &wrong));
        CHECK(wrong == (echocast_pings *)bad[b]);
    }
    static const size_t no_sizes[] = {0, 7, 9, sizeof scan - 1, 4097, SIZE_MAX};
    for (size_t i = 0; i < sizeof no_sizes / sizeof *no_sizes; ++i) {
        echocast_scan_desc wrong = scan;
        wrong.struct_size = no_sizes[i];
        REFUSED(echocast_ping(snapshot, &wrong, &pings));
    }
    CHECK(pings == NULL);
    OK(echocast_ping(snapshot, &scan, &pings));
    for (size_t i = 0; i < sizeof odd / sizeof *odd; ++i) {
        here.pose.m[11] = odd[i];
        REFUSED(echocast_ping(snapshot, &scan, &pings));
    }
    CHECK(echocast_pings_count(pings) == 1 && echocast_pings_count((echocast_pings *)somewhere) == 0);
    echocast_ping_info ping_info = ECHOCAST_PING_INFO_INIT;
    BAD_HANDLES(echocast_pings, wrong, echocast_pings_get_info(wrong, 0, &ping_info));
    REFUSED(echocast_pings_get_info(pings, 1, &ping_info));
    REFUSED(echocast_pings_get_info(pings, 0, NULL));
    for (size_t i = 0; i < sizeof no_sizes / sizeof *no_sizes; ++i) {
        ping_info.struct_size = no_sizes[i];
        REFUSED(echocast_pings_get_info(pings, 0, &ping_info));
    }
    BAD_HANDLES(echocast_pings, wrong, echocast_pings_view(wrong, 0, "intensity", &column));
    echocast_radar_info radar_info = ECHOCAST_RADAR_INFO_INIT;
    echocast_radar *radar = NULL;
    REFUSED(echocast_radar_frame(snapshot, &scan, ECHOCAST_RADAR_CUBE, &radar, NULL)); /* a sonar */
    REFUSED(echocast_radar_frame(snapshot, &scan, 4, &radar, NULL));
    REFUSED(echocast_radar_frame(snapshot, NULL, 0, &radar, NULL));
    REFUSED(echocast_radar_frame(snapshot, &scan, 0, NULL, NULL));
    CHECK(radar == NULL);
    BAD_HANDLES(echocast_radar, wrong, echocast_radar_get_info(wrong, &radar_info));
    BAD_HANDLES(echocast_radar, wrong, echocast_radar_write(wrong, "frame.npz"));
    BAD_HANDLES(echocast_radar, wrong, echocast_radar_preview(wrong, "frame.png", "{view: range_doppler}"));
    BAD_TEXTS(name, echocast_pings_view(pings, 0, name, &column));
    REFUSED(echocast_pings_view(pings, SIZE_MAX, "intensity", &column));
    REFUSED(echocast_pings_view(pings, 0, "x", &column));
    CHECK(column.data == NULL && column.count == 0);
    REFUSED(echocast_pings_view(pings, 0, "intensity", NULL));
    echocast_sounding_view depths;
    BAD_HANDLES(echocast_pings, wrong, echocast_pings_soundings(wrong, 0, &depths));
    REFUSED(echocast_pings_soundings(pings, 1, &depths));
    CHECK(depths.data == NULL && depths.count == 0);
    REFUSED(echocast_pings_soundings(pings, 0, NULL));
    echocast_pack_item pixel = {"intensity", ECHOCAST_TYPE_F32, 0, 0, 1};
    BAD_HANDLES(echocast_pings, wrong, echocast_pings_pack(wrong, 0, &pixel, 1, 4, bytes, sizeof bytes, NULL));
    REFUSED(echocast_pings_pack(pings, 1, &pixel, 1, 4, bytes, sizeof bytes, NULL));
    REFUSED(echocast_pings_pack(pings, 0, NULL, 1, 4, bytes, sizeof bytes, NULL));
    REFUSED(echocast_pings_pack(pings, 0, &pixel, 0, 4, bytes, sizeof bytes, NULL));
    REFUSED(echocast_pings_pack(pings, 0, &pixel, SIZE_MAX, 4, bytes, sizeof bytes, NULL));
    REFUSED(echocast_pings_pack(pings, 0, &pixel, 1, 0, bytes, sizeof bytes, NULL));
    REFUSED(echocast_pings_pack(pings, 0, &pixel, 1, SIZE_MAX, bytes, sizeof bytes, NULL));
    REFUSED(echocast_pings_pack(pings, 0, &pixel, 1, 4, NULL, sizeof bytes, NULL));
    REFUSED(echocast_pings_pack(pings, 0, &pixel, 1, 4, bytes, 3, NULL));
    CHECK(echocast_pings_label_name(NULL, "part", 1) == NULL && echocast_pings_label_name(pings, NULL, 1) == NULL);
    CHECK(echocast_pings_label_name(pings, "\xff", 1) == NULL);
    BAD_HANDLES(echocast_pings, wrong, echocast_pings_label_number(wrong, "category", "box", &label));
    BAD_TEXTS(name, echocast_pings_label_number(pings, "category", name, &label));
    REFUSED(echocast_pings_label_number(pings, "category", "box", NULL));
    BAD_HANDLES(echocast_pings, wrong, echocast_pings_append(wrong, pings));
    BAD_HANDLES(echocast_pings, wrong, echocast_pings_append(pings, wrong));
    REFUSED(echocast_pings_append(pings, pings));
    static const char waterfall[] = "{view: waterfall}";
    BAD_HANDLES(echocast_pings, wrong, echocast_pings_image(wrong, waterfall, "values", &layer, NULL));
    BAD_TEXTS(text, echocast_pings_image(pings, text, "values", &layer, NULL));
    BAD_TEXTS(name, echocast_pings_image(pings, waterfall, name, &layer, NULL));
    REFUSED(echocast_pings_image(pings, "", "values", &layer, NULL));
    REFUSED(echocast_pings_image(pings, "{view: waterfall, width: -1}", "values", &layer, NULL));
    CHECK(layer.data == NULL && layer.width == 0);
    REFUSED(echocast_pings_image(pings, waterfall, "values", NULL, NULL));
    REFUSED(echocast_pings_image(pings, waterfall, "values", &layer, (echocast_image_place *)((char *)somewhere + 1)));
    BAD_HANDLES(echocast_pings, wrong, echocast_pings_write(wrong, path));
    BAD_TEXTS(name, echocast_pings_write(pings, name));
    REFUSED(echocast_pings_write(pings, ""));
    REFUSED(echocast_pings_write(pings, argv[1]));
    BAD_HANDLES(echocast_pings, wrong, echocast_pings_preview(wrong, path, waterfall));
    REFUSED(echocast_pings_preview(pings, NULL, waterfall));
    BAD_TEXTS(text, echocast_pings_preview(pings, path, text));
    BAD_HANDLES(echocast_sample, wrong, echocast_sample_ping(wrong, 0, 0, NULL, &pings));
    REFUSED(echocast_sample_ping(sample, 0, 0, NULL, &pings)); /* not a sonar */
    REFUSED(echocast_sample_ping(sample, SIZE_MAX, 0, NULL, &pings));
    REFUSED(echocast_sample_ping(sample, 0, SIZE_MAX, NULL, &pings));
    REFUSED(echocast_sample_ping(sample, 0, 0, "\xff", &pings));
    REFUSED(echocast_sample_ping(sample, 0, 0, NULL, NULL));
    CHECK(echocast_pings_count(pings) == 1);
    echocast_sensor_release(sonar);

    /* Scenarios. */
    echocast_scenario *none;
    BAD_HANDLES(echocast_context, wrong, echocast_scenario_load(wrong == bad[6] ? NULL : wrong, path, &none));
    REFUSED(echocast_scenario_load(context, NULL, &none));
    REFUSED(echocast_scenario_load(context, "", &none));
    REFUSED(echocast_scenario_load(context, argv[1], &none));
    REFUSED(echocast_scenario_load(context, path, NULL));
    BAD_HANDLES(echocast_context, wrong,
                echocast_scenario_from_text(wrong == bad[6] ? NULL : wrong, scenario_yaml, NULL, &none));
    BAD_TEXTS(yaml, echocast_scenario_from_text(context, yaml, NULL, &none));
    REFUSED(echocast_scenario_from_text(context, "", NULL, &none));
    REFUSED(echocast_scenario_from_text(context, "[[[[[[", NULL, &none));
    REFUSED(echocast_scenario_from_text(context, deep, NULL, &none));
    REFUSED(echocast_scenario_from_text(context, scenario_yaml, NULL, NULL));
    BAD_HANDLES(echocast_scenario, wrong, echocast_scenario_set(wrong, "samples", "2"));
    BAD_TEXTS(key, echocast_scenario_set(scenario, key, "2"));
    BAD_TEXTS(value, echocast_scenario_set(scenario, "samples", value));
    REFUSED(echocast_scenario_set(scenario, "", ""));
    REFUSED(echocast_scenario_set(scenario, "samples", "-1"));
    REFUSED(echocast_scenario_set(scenario, "samples", "[[[[[["));
    REFUSED(echocast_scenario_set(scenario, deep, "1"));
    REFUSED(echocast_scenario_set(scenario, "samples", wide));
    CHECK(strlen(echocast_last_error()) < 1000);
    uint64_t samples;
    BAD_HANDLES(echocast_scenario, wrong, echocast_scenario_samples(wrong, &samples));
    REFUSED(echocast_scenario_samples(scenario, NULL));
    REFUSED(echocast_scenario_samples(scenario, (uint64_t *)((char *)somewhere + 1)));
    BAD_HANDLES(echocast_scenario, wrong, echocast_scenario_sample(wrong, 0, (echocast_sample **)&out));
    REFUSED(echocast_scenario_sample(scenario, 0, NULL));
    REFUSED(echocast_scenario_sample(scenario, UINT64_MAX, (echocast_sample **)&out));
    BAD_HANDLES(echocast_sample, wrong, echocast_sample_scans(wrong, &needed));
    REFUSED(echocast_sample_scans(sample, NULL));
    echocast_scan_info scan_info = ECHOCAST_SCAN_INFO_INIT;
    BAD_HANDLES(echocast_sample, wrong, echocast_sample_get_scan(wrong, 0, &scan_info));
    REFUSED(echocast_sample_get_scan(sample, SIZE_MAX, &scan_info));
    REFUSED(echocast_sample_get_scan(sample, 0, NULL));
    echocast_frame_info frame_info = ECHOCAST_FRAME_INFO_INIT;
    BAD_HANDLES(echocast_sample, wrong, echocast_sample_get_frame(wrong, 0, 0, &frame_info));
    REFUSED(echocast_sample_get_frame(sample, 1, 0, &frame_info));
    REFUSED(echocast_sample_get_frame(sample, 0, SIZE_MAX, &frame_info));
    REFUSED(echocast_sample_get_frame(sample, 0, 0, NULL));
    BAD_HANDLES(echocast_sample, wrong, echocast_sample_sensor(wrong, 0, (echocast_sensor **)&out));
    REFUSED(echocast_sample_sensor(sample, SIZE_MAX, (echocast_sensor **)&out));
    REFUSED(echocast_sample_sensor(sample, 0, NULL));
    BAD_HANDLES(echocast_sample, wrong, echocast_sample_drawn(wrong, text, sizeof text, &needed));
    REFUSED(echocast_sample_drawn(sample, NULL, 0, NULL));
    BAD_HANDLES(echocast_sample, wrong, echocast_sample_scan(wrong, 0, 0, NULL, &result));
    REFUSED(echocast_sample_scan(sample, SIZE_MAX, 0, NULL, &result));
    REFUSED(echocast_sample_scan(sample, 0, SIZE_MAX, NULL, &result));
    REFUSED(echocast_sample_scan(sample, 0, 0, "\xff", &result));
    REFUSED(echocast_sample_scan(sample, 0, 0, "", &result));
    REFUSED(echocast_sample_scan(sample, 0, 0, NULL, NULL));
    REFUSED(echocast_sample_scan(sample, 0, 0, NULL, (echocast_result **)((char *)somewhere + 1)));
    for (size_t b = 1; b < sizeof bad / sizeof *bad; ++b) {
        echocast_result *wrong = (echocast_result *)bad[b];
        REFUSED(echocast_sample_scan(sample, 0, 0, NULL, &wrong));
        CHECK(wrong == (echocast_result *)bad[b]);
    }
    OK(echocast_sample_scan(sample, 0, 0, NULL, &result));
    CHECK(echocast_result_count(result) > 0);

    /* Files. */
    BAD_HANDLES(echocast_result, wrong, echocast_result_write(wrong, path, NULL));
    BAD_TEXTS(name, echocast_result_write(result, name, NULL));
    REFUSED(echocast_result_write(result, "", NULL));
    REFUSED(echocast_result_write(result, path, "\xff"));
    REFUSED(echocast_result_write(result, argv[1], "las"));
    /* Names of files are bytes. */
    char odd_path[600];
    snprintf(odd_path, sizeof odd_path, "%s/odd\xff.csv", argv[1]);
    OK(echocast_result_write(result, odd_path, NULL));
    snprintf(odd_path, sizeof odd_path, "%s/no\xff.obj", argv[1]);
    CHECK(echocast_scene_load(scene, odd_path, NULL) == ECHOCAST_E_IO);
    CHECK(strstr(echocast_last_error(), "/no\\xff.obj: No such file") != NULL);
    BAD_HANDLES(echocast_result, wrong, echocast_result_preview(wrong, path, NULL));
    REFUSED(echocast_result_preview(result, NULL, NULL));
    REFUSED(echocast_result_preview(result, path, "\xff"));
    REFUSED(echocast_result_preview(result, path, "{width: -1}"));
    echocast_frames *frames = NULL;
    BAD_HANDLES(echocast_context, wrong, echocast_frames_create(wrong == bad[6] ? NULL : wrong, path, &frames));
    REFUSED(echocast_frames_create(context, NULL, &frames));
    REFUSED(echocast_frames_create(context, path, NULL));
    if (echocast_has_feature("hdf5"))
        OK(echocast_frames_create(context, path, &frames));
    BAD_HANDLES(echocast_frames, wrong, echocast_frames_add(wrong, result));
    BAD_HANDLES(echocast_result, wrong, echocast_frames_add(frames, wrong));
    BAD_HANDLES(echocast_frames, wrong, echocast_frames_finish(wrong));
    if (frames)
        OK(echocast_frames_finish(frames));
    REFUSED(echocast_frames_finish(frames));
    REFUSED(echocast_frames_add(frames, result));

    /* Handles of nothing are released without harm, and nothing twice. */
    for (size_t b = 0; b < sizeof bad / sizeof *bad; ++b) {
        echocast_material_release((echocast_material *)bad[b]);
        echocast_mesh_release((echocast_mesh *)bad[b]);
        echocast_scene_release((echocast_scene *)bad[b]);
        echocast_snapshot_release((echocast_snapshot *)bad[b]);
        echocast_sensor_release((echocast_sensor *)bad[b]);
        echocast_result_release((echocast_result *)bad[b]);
        echocast_pings_release((echocast_pings *)bad[b]);
        echocast_frames_release((echocast_frames *)bad[b]);
        echocast_scenario_release((echocast_scenario *)bad[b]);
        echocast_sample_release((echocast_sample *)bad[b]);
        if (bad[b] != context)
            echocast_context_release((echocast_context *)bad[b]);
    }
    for (int twice = 0; twice < 2; ++twice) {
        echocast_sample_release(sample);
        echocast_scenario_release(scenario);
        echocast_frames_release(frames);
        echocast_result_release(result);
        echocast_pings_release(pings);
        echocast_sensor_release(sensor);
        echocast_snapshot_release(snapshot);
        echocast_scene_release(scene);
        echocast_mesh_release(mesh);
        echocast_material_release(material);
        echocast_context_release(context);
    }
    puts("passed");
    return 0;
}
