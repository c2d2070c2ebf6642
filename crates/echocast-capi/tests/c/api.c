/* What the functions do, one after the other, and how they fail. argv[1]: a folder for files. */
#include "check.h"
#include "folder.h"

static int messages[6];
static char last_message[512];

static void take_message(void *user, int32_t level, const char *text)
{
    CHECK(user == messages && level >= 0 && level < 6);
    ++messages[level];
    snprintf(last_message, sizeof last_message, "%s", text);
}

static void library(void)
{
    CHECK(echocast_version() == ECHOCAST_VERSION);
    CHECK(strncmp(echocast_version_string(), "echocast ", 9) == 0);
    CHECK(strcmp(echocast_last_error(), "") == 0);
    CHECK(strcmp(echocast_status_string(ECHOCAST_OK), "ok") == 0);
    CHECK(strcmp(echocast_status_string(12345), "unknown status") == 0);
    CHECK(echocast_has_feature("las") == 1 && echocast_has_feature("gltf") == 1);
    CHECK(echocast_has_feature("true_range") == 1);
    CHECK(echocast_has_feature("hdf") == 0 && echocast_has_feature(NULL) == 0);
    size_t presets = 0;
    int found = 0;
    for (const char *name; (name = echocast_name("presets", presets)) != NULL; ++presets)
        found |= strcmp(name, "velodyne_vlp16") == 0;
    CHECK(found && presets > 20);
    CHECK(strcmp(echocast_name("columns", 0), "x") == 0);
    CHECK(echocast_name("columns", 1000) == NULL && echocast_name("colours", 0) == NULL);
}

static int freed;

static void take_freed(void *user)
{
    CHECK(user == &freed);
    ++freed;
}

static void meshes(echocast_context *context)
{
    echocast_mesh *mesh;
    echocast_mesh_desc desc = box_desc();
    /* Positions among other data. */
    float vertices[8][5];
    for (int i = 0; i < 8; ++i)
        memcpy(vertices[i], BOX_POSITIONS + 3 * i, 12);
    desc.positions = vertices[0];
    desc.position_stride = sizeof vertices[0];
    OK(echocast_mesh_create(context, &desc, &mesh));
    echocast_mesh_release(mesh);
    desc.ownership = ECHOCAST_MESH_BORROW;
    FAILS(ECHOCAST_E_ARGUMENT, "desc->position_stride is 20; allowed: 0 or 12 for borrowed positions",
          echocast_mesh_create(context, &desc, &mesh));
    CHECK(mesh == NULL);
    desc.ownership = 7;
    FAILS(ECHOCAST_E_ARGUMENT, "desc->ownership is 7;", echocast_mesh_create(context, &desc, &mesh));

    desc = box_desc();
    desc.vertex_count = 7;
    FAILS(ECHOCAST_E_ARGUMENT, "part 0: index is 7; allowed: below the number of vertices, 7",
          echocast_mesh_create(context, &desc, &mesh));
    desc = box_desc();
    float broken[24];
    memcpy(broken, BOX_POSITIONS, sizeof broken);
    broken[10] = NAN;
    desc.positions = broken;
    FAILS(ECHOCAST_E_ARGUMENT, "part 0: vertex 3 is [1.0, NaN, -1.0]; allowed: -1e18 to 1e18",
          echocast_mesh_create(context, &desc, &mesh));
    desc = box_desc();
    desc.triangle_count = 0;
    FAILS(ECHOCAST_E_ARGUMENT, "desc->triangle_count is 0;", echocast_mesh_create(context, &desc, &mesh));

    /* Parts of a mesh. */
    echocast_material *material;
    OK(echocast_material_create(context, "{name: brass, reflectance: 0.25}", NULL, &material));
    echocast_part parts[2] = {ECHOCAST_PART_INIT, ECHOCAST_PART_INIT};
    parts[0].triangle_count = 4;
    parts[0].part_id = 11;
    parts[1].first_triangle = 4;
    parts[1].triangle_count = 8;
    parts[1].part_id = 12;
    parts[1].material = material;
    desc = box_desc();
    desc.parts = parts;
    desc.part_count = 2;
    OK(echocast_mesh_create(context, &desc, &mesh));
    echocast_mesh_release(mesh);
    parts[1].first_triangle = 5;
    FAILS(ECHOCAST_E_ARGUMENT, "desc->parts[1].first_triangle is 5; allowed: 4: parts follow each other",
          echocast_mesh_create(context, &desc, &mesh));
    parts[1].first_triangle = 4;
    parts[1].triangle_count = 9;
    FAILS(ECHOCAST_E_ARGUMENT, "desc->parts[1].triangle_count is 9; allowed: 1 to 8",
          echocast_mesh_create(context, &desc, &mesh));
    parts[1].triangle_count = 7;
    FAILS(ECHOCAST_E_ARGUMENT, "the triangles of all desc->parts is 11; allowed: 12",
          echocast_mesh_create(context, &desc, &mesh));
    echocast_material_release(material);
    parts[1].triangle_count = 8;
    FAILS(ECHOCAST_E_HANDLE, "desc->parts[1].material is 0x", echocast_mesh_create(context, &desc, &mesh));

    /* A copy is the library's own. */
    float *positions = malloc(sizeof BOX_POSITIONS);
    memcpy(positions, BOX_POSITIONS, sizeof BOX_POSITIONS);
    desc = box_desc();
    desc.positions = positions;
    OK(echocast_mesh_create(context, &desc, &mesh));
    memset(positions, 0x7f, sizeof BOX_POSITIONS);
    free(positions);
    echocast_scene *scene;
    OK(echocast_scene_create(context, NULL, &scene));
    place(scene, mesh, at(5, 0, 0), 1);
    echocast_mesh_release(mesh);
    echocast_snapshot *snapshot;
    OK(echocast_scene_commit(scene, &snapshot));
    echocast_sensor *sensor = around(context);
    echocast_result *result = NULL;
    scan_into(snapshot, sensor, "range", &result);
    CHECK(close_to(least(result, "range"), 4));
    echocast_snapshot_release(snapshot);
    echocast_scene_release(scene);

    /* Borrowed arrays are given back once nothing uses them, and not if no mesh was made. */
    positions = malloc(sizeof BOX_POSITIONS);
    memcpy(positions, BOX_POSITIONS, sizeof BOX_POSITIONS);
    desc.positions = positions;
    desc.ownership = ECHOCAST_MESH_BORROW;
    desc.released = take_freed;
    desc.released_user = &freed;
    desc.vertex_count = 7;
    FAILS(ECHOCAST_E_ARGUMENT, "part 0: index is 7;", echocast_mesh_create(context, &desc, &mesh));
    desc.vertex_count = 8;
    CHECK(freed == 0);
    OK(echocast_mesh_create(context, &desc, &mesh));
    OK(echocast_mesh_prepare(mesh));
    OK(echocast_scene_create(context, NULL, &scene));
    echocast_instance id = place(scene, mesh, at(3, 0, 0), 1);
    echocast_mesh_release(mesh);
    OK(echocast_scene_commit(scene, &snapshot));
    OK(echocast_scene_remove(scene, id));
    echocast_scene_release(scene);
    CHECK(freed == 0);
    scan_into(snapshot, sensor, "range", &result);
    CHECK(close_to(least(result, "range"), 2));
    echocast_snapshot_release(snapshot);
    CHECK(freed == 1);
    free(positions);
    echocast_result_release(result);
    echocast_sensor_release(sensor);
}

static void scenes(echocast_context *context)
{
    echocast_scene *scene;
    double origin[3] = {500000, 5600000, NAN};
    echocast_scene_desc scene_desc = ECHOCAST_SCENE_DESC_INIT;
    scene_desc.origin = origin;
    FAILS(ECHOCAST_E_ARGUMENT, "origin is [500000, 5600000, NaN]", echocast_scene_create(context, &scene_desc, &scene));
    origin[2] = 0;
    OK(echocast_scene_create(context, &scene_desc, &scene));
    echocast_mesh *mesh = box(context);
    echocast_instance car = place(scene, mesh, at(500005, 5600000, 0), 7);
    echocast_snapshot *snapshot;
    OK(echocast_scene_commit(scene, &snapshot));
    echocast_sensor *sensor = around(context);
    echocast_pose_key here = {0, at(500000, 5600000, 0)};
    echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
    desc.sensor = sensor;
    desc.poses = &here;
    desc.pose_count = 1;
    echocast_result *result = NULL;
    OK(echocast_scan(snapshot, &desc, &result));
    echocast_result_info info = ECHOCAST_RESULT_INFO_INIT;
    OK(echocast_result_get_info(result, &info));
    CHECK(info.origin[0] == 500000 && info.origin[1] == 5600000 && info.sensor_pose.m[3] == 500000);
    CHECK(info.count == echocast_result_count(result) && info.rows == 0 && info.intensity_full_scale == 1);
    CHECK(close_to(least(result, "x"), 4));
    CHECK(*(const uint32_t *)view(result, "instance_id").data == 7);
    CHECK(strcmp(echocast_result_label_name(result, "instance", 7), "box") == 0);
    CHECK(echocast_result_label_name(result, "instance", 8) == NULL);
    CHECK(echocast_result_label_name(result, "planet", 8) == NULL);
    /* A default column of sensors that measure it. */
    echocast_view doppler;
    CHECK(echocast_result_view(result, "doppler", &doppler) != ECHOCAST_OK);
    OK(echocast_sensor_set(sensor, "doppler.sigma_m_s", "0"));
    OK(echocast_scan(snapshot, &desc, &result));
    doppler = view(result, "doppler");
    CHECK(doppler.count == echocast_result_count(result) && *(const float *)doppler.data == 0);
    OK(echocast_sensor_set(sensor, "doppler", "null"));
    echocast_snapshot_release(snapshot);

    /* Edits; ids of what is gone. */
    OK(echocast_scene_name_label(scene, "category", 9, "car"));
    FAILS(ECHOCAST_E_ARGUMENT, "table is \"colour\"", echocast_scene_name_label(scene, "colour", 9, "car"));
    OK(echocast_scene_set_labels(scene, car, 9, 8, NULL, 0));
    uint32_t part = 5;
    OK(echocast_scene_set_labels(scene, car, 9, 8, &part, 1));
    FAILS(ECHOCAST_E_ARGUMENT, "part numbers is 0;", echocast_scene_set_labels(scene, car, 9, 8, &part, 0));
    echocast_instance found;
    OK(echocast_scene_find(scene, "box", &found));
    CHECK(found == car);
    FAILS(ECHOCAST_E_ARGUMENT, "there is no object named \"bax\"; near: box", echocast_scene_find(scene, "bax", &found));
    CHECK(found == 0);
    echocast_pose pose;
    FAILS(ECHOCAST_E_ARGUMENT, "there is no camera node named \"eye\"", echocast_scene_camera(scene, "eye", &pose));
    uint32_t label = 7;
    OK(echocast_scene_label_number(scene, "category", "car", &label));
    CHECK(label == 9);
    FAILS(ECHOCAST_E_ARGUMENT, "there is no label named \"cat\"; near: car",
          echocast_scene_label_number(scene, "category", "cat", &label));
    CHECK(label == 0);
    FAILS(ECHOCAST_E_ARGUMENT, "table is \"planet\"; allowed: category, part, material, instance",
          echocast_scene_label_number(scene, "planet", "car", &label));
    float positions[24];
    for (int i = 0; i < 24; ++i)
        positions[i] = 2 * BOX_POSITIONS[i];
    OK(echocast_scene_set_vertices(scene, car, positions, NULL, 8));
    FAILS(ECHOCAST_E_ARGUMENT, "count is 9; allowed: the vertices of its mesh, 8",
          echocast_scene_set_vertices(scene, car, positions, NULL, 9));
    OK(echocast_scene_commit(scene, &snapshot));
    OK(echocast_scan(snapshot, &desc, &result));
    CHECK(close_to(least(result, "x"), 3));
    CHECK(*(const uint32_t *)view(result, "category_id").data == 9 && *(const uint32_t *)view(result, "part_id").data == 5);
    CHECK(strcmp(echocast_result_label_name(result, "category", 9), "car") == 0);
    OK(echocast_result_label_number(result, "category", "car", &label));
    CHECK(label == 9);
    FAILS(ECHOCAST_E_ARGUMENT, "there is no label named \"tree\"",
          echocast_result_label_number(result, "category", "tree", &label));
    echocast_snapshot_release(snapshot);

    /* Vertices on their way, half of which has passed; the time of a scan counts once time does not stand still. */
    float on_way[48];
    for (int i = 0; i < 48; ++i)
        on_way[i] = 2 * BOX_POSITIONS[i % 24] + (i >= 24 && i % 3 == 0);
    int64_t way_ns[2] = {0, 1000000000}, back_ns[2] = {5, 5};
    OK(echocast_scene_set_vertex_motion(scene, car, way_ns, 2, on_way, 8));
    FAILS(ECHOCAST_E_ARGUMENT, "count is 9; allowed: the vertices of its mesh, 8",
          echocast_scene_set_vertex_motion(scene, car, way_ns, 2, on_way, 9));
    FAILS(ECHOCAST_E_ARGUMENT, "time of key 1", echocast_scene_set_vertex_motion(scene, car, back_ns, 2, on_way, 8));
    FAILS(ECHOCAST_E_ARGUMENT, "keys is none", echocast_scene_set_vertex_motion(scene, car, NULL, 0, NULL, 8));
    OK(echocast_scene_set_time(scene, 500000000, 0));
    OK(echocast_scene_commit(scene, &snapshot));
    OK(echocast_scan(snapshot, &desc, &result));
    CHECK(close_to(least(result, "x"), 3.5f));
    echocast_snapshot_release(snapshot);
    OK(echocast_scene_set_time(scene, 0, 0));
    OK(echocast_scene_set_vertices(scene, car, positions, NULL, 8));

    OK(echocast_scene_set_mask(scene, car, 2));
    OK(echocast_scene_commit(scene, &snapshot));
    desc.mask = 1;
    OK(echocast_scan(snapshot, &desc, &result));
    CHECK(echocast_result_count(result) == 0 && view(result, "x").data == NULL);
    desc.mask = 2;
    OK(echocast_scan(snapshot, &desc, &result));
    CHECK(echocast_result_count(result) > 0);
    desc.mask = 0;
    FAILS(ECHOCAST_E_ARGUMENT, "desc->mask is 0;", echocast_scan(snapshot, &desc, &result));
    CHECK(echocast_result_count(result) > 0);
    echocast_snapshot_release(snapshot);

    echocast_material *material;
    OK(echocast_material_create(context, "{name: gold, reflectance: 0.125}", NULL, &material));
    OK(echocast_scene_set_material(scene, car, material));
    echocast_material_release(material);
    OK(echocast_scene_set_mask(scene, car, 0xffffffffu));
    OK(echocast_scene_commit(scene, &snapshot));
    desc.mask = 0xffffffffu;
    desc.columns = "intensity,cos_incidence,material_id";
    OK(echocast_scan(snapshot, &desc, &result));
    const float *intensity = view(result, "intensity").data, *incidence = view(result, "cos_incidence").data;
    for (size_t i = 0; i < echocast_result_count(result); ++i)
        CHECK(close_to(intensity[i], 0.125 * incidence[i]));
    uint32_t number = *(const uint32_t *)view(result, "material_id").data;
    CHECK(strcmp(echocast_result_label_name(result, "material", number), "gold") == 0);
    echocast_snapshot_release(snapshot);
    OK(echocast_scene_set_material(scene, car, NULL));

    echocast_instance ids[2] = {car, car + 1};
    echocast_pose poses[2] = {at(1, 2, 3), at(4, 5, 6)};
    FAILS(ECHOCAST_E_HANDLE, "ids[1] is 0x", echocast_scene_set_poses(scene, 2, ids, poses));
    poses[0].m[3] = INFINITY;
    FAILS(ECHOCAST_E_ARGUMENT, "poses[0] is such that it reaches to [inf", echocast_scene_set_poses(scene, 1, ids, poses));
    memset(poses, 0, sizeof poses);
    FAILS(ECHOCAST_E_ARGUMENT, "poses[0] is all 0;", echocast_scene_set_poses(scene, 1, ids, poses));
    echocast_instance other, listed[3];
    size_t known;
    echocast_instance_desc another = ECHOCAST_INSTANCE_DESC_INIT;
    another.mesh = mesh;
    another.pose = at(500000, 5600009, 1);
    another.instance_id = 8; /* as the first, which has named it */
    another.name = "second";
    OK(echocast_scene_add(scene, &another, &other));
    OK(echocast_scene_get_instances(scene, 0, 3, listed, &known));
    CHECK(known == 2 && listed[0] == car && listed[1] == other);
    OK(echocast_scene_get_instances(scene, 1, 1, listed, NULL));
    CHECK(listed[0] == other);
    OK(echocast_scene_get_instances(scene, 7, 1, listed, NULL));
    char name[5];
    echocast_instance_info instance = ECHOCAST_INSTANCE_INFO_INIT;
    instance.name = name;
    instance.name_capacity = sizeof name;
    OK(echocast_scene_get_instance(scene, other, &instance));
    CHECK(instance.pose.m[7] == 5600009 && instance.instance_id == 8 && instance.part_count == 1);
    CHECK(instance.triangle_count == 12 && strcmp(name, "seco") == 0 && instance.name == name);
    OK(echocast_scene_remove(scene, other));
    FAILS(ECHOCAST_E_HANDLE, "id is 0x", echocast_scene_get_instance(scene, other, &instance));
    echocast_scene_info what = ECHOCAST_SCENE_INFO_INIT;
    OK(echocast_scene_get_info(scene, &what));
    CHECK(what.instances == 1 && what.triangles == 12 && what.low[0] == 500003 && what.high[0] == 500007);
    CHECK(what.cameras == 0);
    OK(echocast_scene_remove(scene, car));
    FAILS(ECHOCAST_E_HANDLE, "id is 0x", echocast_scene_remove(scene, car));
    echocast_instance_desc place_desc = ECHOCAST_INSTANCE_DESC_INIT;
    place_desc.mesh = mesh;
    place_desc.mask = 0;
    FAILS(ECHOCAST_E_ARGUMENT, "desc->mask is 0;", echocast_scene_add(scene, &place_desc, NULL));
    place_desc.mask = 1;
    place_desc.fixed = 2;
    FAILS(ECHOCAST_E_ARGUMENT, "desc->fixed is 2;", echocast_scene_add(scene, &place_desc, NULL));
    place_desc.fixed = 1;
    OK(echocast_scene_add(scene, &place_desc, NULL));

    echocast_mesh_release(mesh);
    echocast_result_release(result);
    echocast_sensor_release(sensor);
    echocast_scene_release(scene);
}

/* A box that moves while it is scanned, and how fast its points are, also as colours of a picture. */
static void pictures_of_motion(echocast_context *context)
{
    echocast_scene *scene;
    OK(echocast_scene_create(context, NULL, &scene));
    echocast_mesh *mesh = box(context);
    echocast_instance mover = place(scene, mesh, at(5, 0, 0), 1);
    place(scene, mesh, at(-5, 0, 0), 2);
    echocast_pose_key way[2] = {{0, at(5, 0, 0)}, {1000000000, at(5, 3, 0)}};
    OK(echocast_scene_set_motion(scene, mover, way, 2));
    FAILS(ECHOCAST_E_ARGUMENT, "", echocast_scene_set_time(scene, 0, -1));
    OK(echocast_scene_set_time(scene, 0, 200000000));
    echocast_snapshot *snapshot;
    OK(echocast_scene_commit(scene, &snapshot));
    echocast_sensor *sensor = around(context);
    echocast_result *result = NULL;
    memset(messages, 0, sizeof messages);
    scan_into(snapshot, sensor, "x,y,z,velocity,radial_velocity", &result);
    echocast_view x = view(result, "x"), velocity = view(result, "velocity_y");
    size_t moving = 0;
    for (size_t i = 0; i < x.count; ++i) {
        const int ahead = ((const float *)x.data)[i] > 0;
        CHECK(close_to(((const float *)velocity.data)[i], ahead ? 3 : 0));
        moving += (size_t)ahead;
    }
    CHECK(moving > 0 && moving < x.count);
    OK(echocast_result_preview(result, in_folder("motion.png"), "{view: top, color: velocity, width: 400}"));
    OK(echocast_result_preview(result, in_folder("motion.png"), "{color: radial_velocity, width: 400}"));
    CHECK(exists(in_folder("motion.png")) && messages[ECHOCAST_LOG_WARN] == 0);
    OK(echocast_result_preview(result, in_folder("motion.png"), "{color: doppler, width: 400}"));
    CHECK(messages[ECHOCAST_LOG_WARN] == 1);

    echocast_result_release(result);
    echocast_sensor_release(sensor);
    echocast_snapshot_release(snapshot);
    echocast_mesh_release(mesh);
    echocast_scene_release(scene);
}

static void files(echocast_context *context)
{
    const char *path = in_folder("wall.obj");
    FILE *file = fopen(path, "w");
    CHECK(file);
    fputs("o wall\nv 8 -9 -9\nv 8 9 -9\nv 8 0 19\nusemtl brick\nf 1 2 3\nf 1 1 3\n", file);
    fclose(file);
    echocast_scene *scene;
    OK(echocast_scene_create(context, NULL, &scene));
    memset(messages, 0, sizeof messages);
    OK(echocast_scene_load(scene, path, "{scale: 0.5, labels: {numbers: {barrier: 12}, objects: {wall: barrier}}}"));
    CHECK(messages[ECHOCAST_LOG_WARN] == 2 && messages[ECHOCAST_LOG_INFO] == 1);
    FAILS(ECHOCAST_E_PARSE, "load options: ", echocast_scene_load(scene, path, "{scal: 0.5}"));
    FAILS(ECHOCAST_E_IO, in_folder("gone.obj"), echocast_scene_load(scene, in_folder("gone.obj"), NULL));
    FAILS(ECHOCAST_E_UNSUPPORTED, in_folder("wall.blend"), echocast_scene_load(scene, in_folder("wall.blend"), ""));
    FAILS(ECHOCAST_E_PARSE, "glTF data: ", echocast_scene_load_memory(scene, "glTF", 4, NULL));

    echocast_snapshot *snapshot;
    OK(echocast_scene_commit(scene, &snapshot));
    echocast_sensor *sensor = around(context);
    echocast_result *result = NULL, *other = NULL;
    scan_into(snapshot, sensor, NULL, &result);
    scan_into(snapshot, sensor, NULL, &other);
    CHECK(close_to(least(result, "range"), 4));
    CHECK(strcmp(echocast_result_label_name(result, "category", 12), "barrier") == 0);
    size_t count = echocast_result_count(result);
    OK(echocast_result_append(result, other));
    CHECK(echocast_result_count(result) == 2 * count);
    FAILS(ECHOCAST_E_ARGUMENT, "other is the same result;", echocast_result_append(result, result));

    for (size_t i = 0; echocast_name("formats", i) != NULL; ++i) {
        OK(echocast_result_write(result, in_folder("cloud"), echocast_name("formats", i)));
        CHECK(exists(in_folder("cloud")));
        remove(in_folder("cloud"));
    }
    OK(echocast_result_write(result, in_folder("cloud.las"), NULL));
    FAILS(ECHOCAST_E_UNSUPPORTED, "the ending of the output file ", echocast_result_write(result, in_folder("cloud.xyzw"), NULL));
    FAILS(ECHOCAST_E_ARGUMENT, "there is no output format named \"lass\"; near: las",
          echocast_result_write(result, in_folder("cloud.las"), "lass"));
    FAILS(ECHOCAST_E_IO, in_folder("no/cloud.las"), echocast_result_write(result, in_folder("no/cloud.las"), NULL));
    OK(echocast_result_preview(result, in_folder("cloud.png"), "{view: top, color: range, width: 400}"));
    CHECK(exists(in_folder("cloud.png")));
    FAILS(ECHOCAST_E_PARSE, "preview options: ", echocast_result_preview(result, in_folder("cloud.png"), "{view: side}"));

    echocast_frames *frames;
    if (echocast_has_feature("hdf5")) {
        OK(echocast_frames_create(context, in_folder("frames.h5"), &frames));
        OK(echocast_frames_add(frames, other));
        OK(echocast_frames_add(frames, other));
        CHECK(!exists(in_folder("frames.h5")));
        OK(echocast_frames_finish(frames));
        CHECK(exists(in_folder("frames.h5")));
        FAILS(ECHOCAST_E_ARGUMENT, "frames is finished;", echocast_frames_finish(frames));
        FAILS(ECHOCAST_E_ARGUMENT, "frames is finished;", echocast_frames_add(frames, other));
        echocast_frames_release(frames);
        OK(echocast_frames_create(context, in_folder("dropped.h5"), &frames));
        OK(echocast_frames_add(frames, other));
        echocast_frames_release(frames);
        CHECK(!exists(in_folder("dropped.h5")));
    } else {
        FAILS(ECHOCAST_E_UNSUPPORTED, "HDF5", echocast_frames_create(context, in_folder("frames.h5"), &frames));
    }
    echocast_result_release(result);
    echocast_result_release(other);
    echocast_sensor_release(sensor);
    echocast_snapshot_release(snapshot);
    echocast_scene_release(scene);
}

static void sensors(echocast_context *context)
{
    echocast_sensor *sensor;
    FAILS(ECHOCAST_E_ARGUMENT, "there is no sensor preset named \"velodyne_vlp17\"; near: velodyne_vlp16",
          echocast_sensor_create(context, "velodyne_vlp17", &sensor));
    CHECK(sensor == NULL);
    FAILS(ECHOCAST_E_IO, "no.yaml: ", echocast_sensor_create(context, "no.yaml", &sensor));
    FAILS(ECHOCAST_E_PARSE, "YAML text: line 1: ", echocast_sensor_from_text(context, "{name: 1", NULL, &sensor));
    OK(echocast_sensor_create(context, "velodyne_vlp16", &sensor));
    echocast_sensor_info info = ECHOCAST_SENSOR_INFO_INIT;
    OK(echocast_sensor_get_info(sensor, &info));
    CHECK(info.rows == 16 && info.columns > 1000 && info.period_ns > 90000000);
    double value, min, max;
    OK(echocast_sensor_set(sensor, "noise.range_sigma_m", "0.25"));
    OK(echocast_sensor_get(sensor, "noise.range_sigma_m", &value, &min, &max));
    CHECK(value == 0.25 && min == 0 && max >= 1);
    OK(echocast_sensor_get(sensor, "noise.range_sigma_m", NULL, NULL, NULL));
    FAILS(ECHOCAST_E_PARSE, "noise.range_sigma_m=-1", echocast_sensor_set(sensor, "noise.range_sigma_m", "-1"));
    OK(echocast_sensor_get(sensor, "noise.range_sigma_m", &value, NULL, NULL));
    CHECK(value == 0.25);
    CHECK(echocast_sensor_get(sensor, "noise.range_sigm", &value, NULL, NULL) == ECHOCAST_E_ARGUMENT);
    size_t needed;
    OK(echocast_sensor_describe(sensor, NULL, 0, &needed));
    char *yaml = malloc(needed);
    OK(echocast_sensor_describe(sensor, yaml, needed, NULL));
    CHECK(strlen(yaml) + 1 == needed && strstr(yaml, "range_sigma_m: 0.25"));
    char little[8];
    OK(echocast_sensor_describe(sensor, little, sizeof little, &needed));
    CHECK(strlen(little) == 7 && strncmp(yaml, little, 7) == 0);
    echocast_sensor *same;
    OK(echocast_sensor_from_text(context, yaml, NULL, &same));
    free(yaml);

    size_t count = (size_t)info.rows * info.columns;
    echocast_beam *beams = malloc(count * sizeof *beams);
    OK(echocast_sensor_get_beams(sensor, 0, count, beams));
    FAILS(ECHOCAST_E_ARGUMENT, "first + count is 1 + ", echocast_sensor_get_beams(sensor, 1, count, beams));
    OK(echocast_sensor_get_beams(sensor, count, 0, NULL));
    echocast_sensor *copy;
    echocast_beams_desc desc = ECHOCAST_BEAMS_DESC_INIT;
    desc.name = "copy";
    desc.beams = beams;
    desc.rows = info.rows;
    desc.columns = info.columns;
    desc.period_ns = info.period_ns;
    desc.firing = ECHOCAST_FIRING_COLUMNS;
    OK(echocast_sensor_from_beams(context, &desc, &copy));
    /* Higher by a decimetre, the beams start there. */
    beams[3].origin[2] = 0.1f;
    echocast_sensor *raised;
    OK(echocast_sensor_from_beams(context, &desc, &raised));
    echocast_beam back[2];
    OK(echocast_sensor_get_beams(raised, 2, 2, back));
    CHECK(back[0].origin[2] == 0 && back[1].origin[2] == 0.1f && back[1].reserved == 0);
    echocast_sensor_release(raised);
    beams[3].origin[2] = INFINITY;
    echocast_sensor *nowhere;
    FAILS(ECHOCAST_E_ARGUMENT, "origin of beam 3 is (0, 0, inf) m", echocast_sensor_from_beams(context, &desc, &nowhere));
    beams[3].origin[2] = 0;
    beams[3].direction[0] = 7;
    echocast_sensor *none;
    FAILS(ECHOCAST_E_ARGUMENT, "direction of beam 3 is (7", echocast_sensor_from_beams(context, &desc, &none));
    free(beams);

    /* The copy sees the same. */
    OK(echocast_sensor_set(sensor, "beam", "{}")); /* one ray each */
    OK(echocast_sensor_set(sensor, "noise", "{}"));
    OK(echocast_sensor_set(sensor, "detection", "{model: none}"));
    OK(echocast_sensor_set(sensor, "range", "{}"));
    OK(echocast_sensor_set(sensor, "intensity", "{}"));
    echocast_scene *scene;
    OK(echocast_scene_create(context, NULL, &scene));
    echocast_mesh *mesh = box(context);
    place(scene, mesh, at(4, 0, 0), 1);
    echocast_snapshot *snapshot;
    OK(echocast_scene_commit(scene, &snapshot));
    echocast_result *a = NULL, *b = NULL;
    scan_into(snapshot, sensor, "all", &a);
    scan_into(snapshot, copy, "all", &b);
    CHECK(echocast_result_count(a) > 100);
    check_same(a, b, "time"); /* rounded to nanoseconds */
    echocast_result_release(a);
    echocast_result_release(b);
    echocast_snapshot_release(snapshot);
    echocast_scene_release(scene);
    echocast_mesh_release(mesh);
    echocast_sensor_release(copy);
    echocast_sensor_release(same);
    echocast_sensor_release(sensor);
}

static int32_t count_calls(void *user, double fraction)
{
    CHECK(fraction > 0 && fraction <= 1);
    return ++*(int *)user == 1000000;
}

static int32_t give_up(void *user, double fraction)
{
    (void)fraction;
    ++*(int *)user;
    return 1;
}

/* Points as ROS 2 drivers publish them: the fields by name, type and offset, as those of a sensor_msgs/PointCloud2. */
static void drivers(echocast_context *context, const echocast_snapshot *snapshot, const echocast_scan_desc *as)
{
    static const char *const wanted[] = {
        "x 1 0, y 1 4, z 1 8, intensity 1 12, ring 4 16, time 1 18, 22",
        "x 1 0, y 1 4, z 1 8, intensity 1 16, t 5 20, reflectivity 4 24, ring 4 26, ambient 4 28, range 5 32, 48",
        "x 1 0, y 1 4, z 1 8, intensity 1 12, ring 4 16, timestamp 2 18, 26",
        "x 1 0, y 1 4, z 1 8, intensity 1 12, ring 4 16, timestamp 2 18, 26",
        "x 1 0, y 1 4, z 1 8, intensity 1 12, tag 3 16, line 3 17, timestamp 2 18, 26",
        "x 1 0, y 1 4, z 1 8, intensity 3 12, return_type 3 13, channel 4 14, azimuth 1 16, elevation 1 20, "
        "distance 1 24, time_stamp 5 28, 32"};
    echocast_driver_info info = ECHOCAST_DRIVER_INFO_INIT;
    FAILS(ECHOCAST_E_ARGUMENT, "driver is 0; allowed: 1 to 6, an ECHOCAST_DRIVER_ number", echocast_driver_get_info(0, &info));
    FAILS(ECHOCAST_E_ARGUMENT, "driver is 7;", echocast_driver_get_info(7, &info));
    for (int32_t driver = ECHOCAST_DRIVER_VELODYNE; driver <= ECHOCAST_DRIVER_AUTOWARE; ++driver) {
        char told[400] = "";
        OK(echocast_driver_get_info(driver, &info));
        for (size_t i = 0; i < info.field_count; ++i)
            snprintf(told + strlen(told), sizeof told - strlen(told), "%s %d %u, ", info.fields[i].name,
                     (int)info.fields[i].kind, (unsigned)info.fields[i].offset);
        snprintf(told + strlen(told), sizeof told - strlen(told), "%zu", info.point_step);
        CHECK(strcmp(told, wanted[driver - 1]) == 0);
    }

    echocast_scan_desc desc = *as;
    echocast_sensor *sensor;
    echocast_sensor_info about = ECHOCAST_SENSOR_INFO_INIT;
    OK(echocast_sensor_create(context, "velodyne_vlp16", &sensor));
    OK(echocast_sensor_get_info(sensor, &about));
    CHECK(about.driver == ECHOCAST_DRIVER_VELODYNE);
    OK(echocast_driver_get_info(about.driver, &info));
    CHECK(strcmp(info.columns, "x,y,z,intensity,ring,time") == 0);
    desc.sensor = sensor;
    desc.columns = info.columns;
    desc.profile = ECHOCAST_PROFILE_PHYSICAL;
    desc.t0_ns = INT64_C(5000000000);
    echocast_result *result = NULL;
    OK(echocast_scan(snapshot, &desc, &result));
    size_t count = echocast_result_count(result), needed;
    OK(echocast_result_pack_driver(result, about.driver, desc.t0_ns, NULL, 0, &needed));
    CHECK(count > 100 && needed == 22 * count);
    unsigned char *bytes = malloc(48 * count + 1);
    bytes[needed] = 77;
    OK(echocast_result_pack_driver(result, about.driver, desc.t0_ns, bytes, needed, NULL));
    CHECK(bytes[needed] == 77);
    const uint16_t *ring = view(result, "ring").data;
    const double *time = view(result, "time").data;
    for (size_t i = 0; i < count; ++i) {
        float place[3], seconds;
        uint16_t packed;
        memcpy(place, bytes + 22 * i, sizeof place);
        memcpy(&packed, bytes + 22 * i + 16, 2);
        memcpy(&seconds, bytes + 22 * i + 18, 4);
        /* Rings rise by 2 degrees from -15, and times count from the stamp. */
        double up = atan2(place[2], hypot(place[0], place[1])) * 57.29577951308232;
        CHECK(packed == ring[i] && fabs(up - (2.0 * packed - 15)) < 0.1);
        CHECK(seconds >= 0 && seconds < 0.1 && fabs(seconds - (time[i] - 5)) < 1e-6);
    }
    FAILS(ECHOCAST_E_ARGUMENT, "capacity is ", echocast_result_pack_driver(result, 1, 0, bytes, needed - 1, NULL));
    FAILS(ECHOCAST_E_ARGUMENT, "driver is 9;", echocast_result_pack_driver(result, 9, 0, bytes, needed, NULL));
    FAILS(ECHOCAST_E_ARGUMENT, "the cloud is without the column return_number; allowed: clouds with",
          echocast_result_pack_driver(result, ECHOCAST_DRIVER_LIVOX, 0, bytes, 48 * count, NULL));
    /* No point is before its scan, whenever that is. */
    desc.t0_ns = INT64_C(1700000000100000000);
    OK(echocast_scan(snapshot, &desc, &result));
    OK(echocast_result_pack_driver(result, about.driver, desc.t0_ns, bytes, 48 * count, NULL));
    for (size_t i = 0; i < echocast_result_count(result); ++i) {
        float seconds;
        memcpy(&seconds, bytes + 22 * i + 18, 4);
        CHECK(seconds >= 0 && seconds < 0.1);
    }

    /* As an image, in which rings are side by side. */
    uint32_t height, width;
    OK(echocast_result_driver_shape(result, about.driver, &height, &width));
    CHECK(height == 1 && width == echocast_result_count(result));
    desc.organised = 1;
    OK(echocast_scan(snapshot, &desc, &result));
    OK(echocast_result_driver_shape(result, about.driver, &height, &width));
    count = echocast_result_count(result);
    CHECK(width == 16 && height > 1000 && (size_t)height * width == count);
    bytes = realloc(bytes, 22 * count);
    OK(echocast_result_pack_driver(result, about.driver, desc.t0_ns, bytes, 22 * count, NULL));
    for (size_t i = 0; i < count; ++i) {
        uint16_t packed;
        memcpy(&packed, bytes + 22 * i + 16, 2);
        CHECK(packed == i % 16);
    }
    FAILS(ECHOCAST_E_ARGUMENT, "driver is 0;", echocast_result_driver_shape(result, 0, &height, &width));
    FAILS(ECHOCAST_E_ARGUMENT, "width is NULL", echocast_result_driver_shape(result, 1, &height, NULL));
    free(bytes);
    echocast_result_release(result);
    echocast_sensor_release(sensor);
}

/* A number of a serialised message. */
static double double_at(const unsigned char *message, size_t at)
{
    double number;
    memcpy(&number, message + at, sizeof number);
    return number;
}

/* Messages of ROS 2 as serialised bytes. */
static void ros_messages(echocast_context *context, const echocast_snapshot *snapshot, const echocast_scan_desc *as)
{
    echocast_scan_desc desc = *as;
    echocast_sensor *sensor;
    echocast_result *result = NULL;
    OK(echocast_sensor_create(context, "hokuyo_ust10lx", &sensor));
    desc.sensor = sensor;
    desc.columns = "range,intensity,return_number,beam";
    desc.profile = ECHOCAST_PROFILE_PHYSICAL;
    desc.t0_ns = INT64_C(5250000000);
    OK(echocast_scan(snapshot, &desc, &result));
    size_t size;
    OK(echocast_result_pack_message(result, ECHOCAST_MESSAGE_LASER_SCAN, "laser", NULL, 0, &size));
    /* Header, 7 numbers, and 1081 ranges and intensities with their counts: the text ends at byte 18 behind the 4 of the
       encoding, the numbers begin at 20. */
    CHECK(size == 4 + 20 + 28 + 2 * (4 + 4 * 1081));
    unsigned char *bytes = malloc(size + 1);
    bytes[size] = 77;
    OK(echocast_result_pack_message(result, ECHOCAST_MESSAGE_LASER_SCAN, "laser", bytes, size, NULL));
    CHECK(bytes[size] == 77 && bytes[0] == 0 && bytes[1] == 1 && memcmp(bytes + 16, "laser", 6) == 0);
    int32_t seconds;
    uint32_t nanoseconds, count;
    memcpy(&seconds, bytes + 4, 4);
    memcpy(&nanoseconds, bytes + 8, 4);
    memcpy(&count, bytes + 52, 4);
    CHECK(seconds == 5 && nanoseconds == 250000000 && count == 1081);
    const uint32_t *beam = view(result, "beam").data;
    const float *range = view(result, "range").data;
    size_t seen = 0;
    for (size_t i = 0; i < 1081; ++i) {
        float packed;
        memcpy(&packed, bytes + 56 + 4 * i, 4);
        if (isinf(packed))
            continue;
        CHECK(seen < echocast_result_count(result) && beam[seen] == i && range[seen] == packed);
        ++seen;
    }
    CHECK(seen == echocast_result_count(result) && seen > 10);
    FAILS(ECHOCAST_E_ARGUMENT, "capacity is ",
          echocast_result_pack_message(result, ECHOCAST_MESSAGE_LASER_SCAN, "laser", bytes, size - 1, NULL));
    FAILS(ECHOCAST_E_ARGUMENT, "message is 9; allowed: 1 to 3, an ECHOCAST_MESSAGE_ number",
          echocast_result_pack_message(result, 9, "laser", bytes, size, NULL));
    FAILS(ECHOCAST_E_ARGUMENT, "the cloud is without the column x",
          echocast_result_pack_message(result, ECHOCAST_MESSAGE_LIVOX_CUSTOM, "laser", bytes, size, NULL));
    free(bytes);
    echocast_result_release(result);
    echocast_sensor_release(sensor);

    /* A circle of 2 m at 1 rad/s, half a century after time 0; the IMU measures 100 times a second. */
    echocast_pose_key path[5];
    int64_t start = INT64_C(1700000000000000000);
    for (int i = 0; i < 5; ++i) {
        double angle = 0.01 * i, cosine = cos(angle), sine = sin(angle);
        echocast_pose pose = {{-sine, -cosine, 0, 2 * cosine, cosine, -sine, 0, 2 * sine, 0, 0, 1, 1}};
        path[i].t_ns = start + 10000000 * i;
        path[i].pose = pose;
    }
    unsigned char imu[400], odometry[800];
    OK(echocast_pack_imu(path, 5, ECHOCAST_IMU_IDEAL, 1, INT64_C(340000000004), "imu", imu, sizeof imu, &size));
    /* Stamp 8, text 4 + 4, quaternion 32, covariance 72, angular velocity at 128 behind the encoding. */
    CHECK(size == 4 + 16 + 32 + 72 + 2 * (24 + 72));
    CHECK(double_at(imu, 4 + 16 + 32) == -1);
    CHECK(fabs(double_at(imu, 124 + 16) - 1) < 1e-9 && double_at(imu, 124) == 0);
    /* To the left, where the centre is, and upwards. */
    CHECK(fabs(double_at(imu, 220)) < 1e-6 && fabs(double_at(imu, 228) - 2) < 1e-3 && fabs(double_at(imu, 236) - 9.80665) < 1e-9);
    OK(echocast_pack_odometry(path, 5, start + 15000000, "odom", "base_link", odometry, sizeof odometry, NULL));
    memcpy(&seconds, odometry + 4, 4);
    CHECK(seconds == 1700000000 && memcmp(odometry + 16, "odom", 5) == 0 && memcmp(odometry + 28, "base_link", 10) == 0);
    /* Pose 56, covariance 288, then the twist: ahead, and about the vertical. */
    CHECK(fabs(double_at(odometry, 44) - 2 * cos(0.015)) < 1e-4);
    CHECK(fabs(double_at(odometry, 44 + 344) - 2) < 1e-4 && fabs(double_at(odometry, 44 + 344 + 40) - 1) < 1e-9);
    FAILS(ECHOCAST_E_ARGUMENT, "pose_count is 0", echocast_pack_imu(path, 0, 1, 0, 0, "imu", imu, sizeof imu, NULL));
    FAILS(ECHOCAST_E_ARGUMENT, "imu is 4;", echocast_pack_imu(path, 5, 4, 0, 0, "imu", imu, sizeof imu, NULL));
    path[3].t_ns = path[2].t_ns;
    FAILS(ECHOCAST_E_ARGUMENT, "trajectory key 3 is time ",
          echocast_pack_odometry(path, 5, start, "odom", "base_link", odometry, sizeof odometry, NULL));
}

/* Boxes of programs that were compiled before box_time was there hold at the start of the scan, as they were told. */
static void old_headers(echocast_context *context, const echocast_snapshot *snapshot, const echocast_scan_desc *as)
{
    echocast_scan_desc desc = *as;
    echocast_sensor *sensor;
    OK(echocast_sensor_create(context, "velodyne_vlp16", &sensor));
    desc.sensor = sensor;
    desc.profile = ECHOCAST_PROFILE_PHYSICAL;
    desc.boxes = ECHOCAST_BOXES_OBJECT;
    desc.t0_ns = 1000000000;
    echocast_result *result = NULL;
    size_t whole = desc.struct_size;
    for (int old = 0; old < 2; ++old) {
        desc.struct_size = old ? offsetof(echocast_scan_desc, box_time) : whole;
        echocast_box_view boxes;
        OK(echocast_scan(snapshot, &desc, &result));
        OK(echocast_result_boxes(result, &boxes));
        CHECK(boxes.count == 1);
        int64_t time = ECHOCAST_AT(echocast_box, boxes, 0)->t_ns;
        CHECK(old ? time == desc.t0_ns : time > desc.t0_ns && time < desc.t0_ns + 100000000);
    }
    echocast_result_release(result);
    echocast_sensor_release(sensor);
}

static void scans(echocast_context *context)
{
    echocast_scene *scene;
    OK(echocast_scene_create(context, NULL, &scene));
    echocast_mesh *mesh = box(context);
    place(scene, mesh, at(4, 0, 0), 1);
    echocast_snapshot *snapshot;
    OK(echocast_scene_commit(scene, &snapshot));
    echocast_sensor *sensor;
    OK(echocast_sensor_create(context, "kinect_v2", &sensor));
    OK(echocast_sensor_set(sensor, "pattern.resolution", "[128, 106]")); /* Valgrind is slow */
    echocast_pose_key keys[2] = {{0, ECHOCAST_POSE_IDENTITY}, {100000000, ECHOCAST_POSE_IDENTITY}};
    keys[1].pose.m[3] = 1;
    echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
    desc.sensor = sensor;
    desc.poses = keys;
    desc.pose_count = 2;
    desc.organised = 1;
    desc.coordinates = ECHOCAST_COORDINATES_SENSOR;
    echocast_result *result = NULL;
    OK(echocast_scan(snapshot, &desc, &result));
    echocast_result_info info = ECHOCAST_RESULT_INFO_INIT;
    OK(echocast_result_get_info(result, &info));
    CHECK(info.count == (size_t)info.rows * info.columns && info.columns == 128);
    CHECK(info.coordinates == ECHOCAST_COORDINATES_SENSOR);

    int calls = 0;
    desc.progress = count_calls;
    desc.progress_user = &calls;
    OK(echocast_scan(snapshot, &desc, &result));
    CHECK(calls > 0);
    calls = 0;
    desc.progress = give_up;
    FAILS(ECHOCAST_E_CANCELLED, "cancelled by the progress callback", echocast_scan(snapshot, &desc, &result));
    CHECK(calls == 1 && echocast_result_count(result) == 0);
    echocast_result *none = NULL;
    CHECK(echocast_scan(snapshot, &desc, &none) == ECHOCAST_E_CANCELLED && none == NULL);
    desc.progress = NULL;
    OK(echocast_scan(snapshot, &desc, &result));

    /* Seconds since 1970 do not blur where the sensor is. */
    int64_t now = INT64_C(1790000000123456789);
    desc.t0_ns = now;
    keys[0].t_ns = now;
    keys[1].t_ns = now + 100;
    keys[1].pose = at(100, 0, 0);
    OK(echocast_scan(snapshot, &desc, &result));
    OK(echocast_result_get_info(result, &info));
    CHECK(info.sensor_pose.m[3] == 0);
    desc.t0_ns = now + 50;
    OK(echocast_scan(snapshot, &desc, &result));
    OK(echocast_result_get_info(result, &info));
    CHECK(close_to(info.sensor_pose.m[3], 50));
    desc.t0_ns = INT64_MIN;
    FAILS(ECHOCAST_E_ARGUMENT, "desc->poses[0].t_ns is ", echocast_scan(snapshot, &desc, &result));
    desc.t0_ns = 0;
    keys[0].t_ns = 0;

    keys[1].t_ns = 0;
    FAILS(ECHOCAST_E_ARGUMENT, "desc->poses[1].t_ns is 0; allowed: above that of the pose before it, 0",
          echocast_scan(snapshot, &desc, &result));
    CHECK(echocast_result_count(result) == info.count);
    keys[1].t_ns = 5;
    keys[1].pose.m[0] = 2;
    FAILS(ECHOCAST_E_ARGUMENT, "desc->poses[1].pose is [2.0, ", echocast_scan(snapshot, &desc, &result));
    desc.pose_count = 0;
    FAILS(ECHOCAST_E_ARGUMENT, "desc->pose_count is 0;", echocast_scan(snapshot, &desc, &result));
    desc.pose_count = 1;
    desc.columns = "x,y,zed";
    FAILS(ECHOCAST_E_ARGUMENT, "there is no column named \"zed\"", echocast_scan(snapshot, &desc, &result));
    desc.columns = "intensity";
    OK(echocast_scan(snapshot, &desc, &result));
    echocast_view clear, dim;
    OK(echocast_result_view(result, "intensity", &clear));
    const size_t middle = (size_t)53 * 128 + 64;
    const float before = ((const float *)clear.data)[middle];
    desc.environment = "{rain: {rate_mm_h: 500, drops: false}}";
    OK(echocast_scan(snapshot, &desc, &result)); /* the text is read, and the second time known */
    OK(echocast_scan(snapshot, &desc, &result));
    OK(echocast_result_view(result, "intensity", &dim));
    const float after = ((const float *)dim.data)[middle];
    CHECK(after < before && after > 0);
    desc.environment = "{rain: {rate: 50}}";
    FAILS(ECHOCAST_E_PARSE, "YAML text: line 1: rain.rate: unknown key \"rate\"; near: rate_mm_h", echocast_scan(snapshot, &desc, &result));
    desc.environment = NULL;
    OK(echocast_scan(snapshot, &desc, &result));
    OK(echocast_result_view(result, "intensity", &clear));
    CHECK(((const float *)clear.data)[middle] == before);
    desc.columns = "zed";
    desc.columns = NULL;
    desc.order = 2;
    FAILS(ECHOCAST_E_ARGUMENT, "desc->order is 2; allowed: 0 to 1", echocast_scan(snapshot, &desc, &result));
    desc.order = ECHOCAST_ORDER_TIME;
    FAILS(ECHOCAST_E_ARGUMENT, "order is time;", echocast_scan(snapshot, &desc, &result));
    desc.order = 0;
    desc.profile = ECHOCAST_PROFILE_BLAINDER;
    desc.reflectance = ECHOCAST_REFLECTANCE_ALPHA;
    OK(echocast_scan(snapshot, &desc, &result));
    echocast_view missing;
    FAILS(ECHOCAST_E_ARGUMENT, "column is \"normal_x\", which was not computed; allowed: x, y, z, range",
          echocast_result_view(result, "normal_x", &missing));
    CHECK(missing.data == NULL && missing.count == 0);

    /* Packed points. */
    desc.organised = 0;
    OK(echocast_scan(snapshot, &desc, &result));
    size_t count = echocast_result_count(result), needed;
    static const echocast_pack_item items[] = {{"x", ECHOCAST_TYPE_F32, 0, 0, 1},
                                               {"y", ECHOCAST_TYPE_F32, 4, 0, 1},
                                               {"z", ECHOCAST_TYPE_F32, 8, 0, 1},
                                               {"channel", ECHOCAST_TYPE_U16, 12, 0, 0},
                                               {"time", ECHOCAST_TYPE_F64, 15, 0, 1}};
    FAILS(ECHOCAST_E_ARGUMENT, "capacity is 0; allowed: ", echocast_result_pack(result, items, 5, 23, &needed, 0, &needed));
    needed = 0;
    OK(echocast_result_pack(result, items, 5, 23, NULL, 0, &needed));
    CHECK(count > 100 && needed == 23 * count);
    unsigned char *bytes = malloc(needed);
    OK(echocast_result_pack(result, items, 5, 23, bytes, needed, NULL));
    const float *x = view(result, "x").data;
    const double *time = view(result, "time").data;
    for (size_t i = 0; i < count; ++i) {
        CHECK(memcmp(bytes + 23 * i, x + i, 4) == 0);
        CHECK(memcmp(bytes + 23 * i + 15, time + i, 8) == 0);
    }
    CHECK(echocast_result_pack(result, items, 5, 22, bytes, needed, NULL) == ECHOCAST_E_ARGUMENT);
    CHECK(echocast_result_pack(result, items, 0, 23, bytes, needed, NULL) == ECHOCAST_E_ARGUMENT);
    /* Shifted and scaled: nanoseconds since a time, intensity of bytes. */
    static const echocast_pack_item scaled[] = {{"time", ECHOCAST_TYPE_U32, 0, -0.5, 1e9},
                                                {"intensity", ECHOCAST_TYPE_U8, 4, 0, 255}};
    OK(echocast_result_pack(result, scaled, 2, 5, bytes, needed, NULL));
    const float *intensity = view(result, "intensity").data;
    for (size_t i = 0; i < count; ++i) {
        uint32_t ns;
        memcpy(&ns, bytes + 5 * i, 4);
        CHECK(fabs(ns - 1e9 * (time[i] + 0.5)) <= 1 && fabs(bytes[5 * i + 4] - 255.0 * intensity[i]) <= 0.51);
    }
    echocast_pack_item wrong = {"x", 11, 0, 0, 1};
    FAILS(ECHOCAST_E_ARGUMENT, "items[0]: kind is 11;", echocast_result_pack(result, &wrong, 1, 23, bytes, needed, NULL));
    wrong.column = "normal_x";
    FAILS(ECHOCAST_E_ARGUMENT, "items[0]: column is \"normal_x\"", echocast_result_pack(result, &wrong, 1, 23, bytes, needed, NULL));
    free(bytes);

    drivers(context, snapshot, &desc);
    ros_messages(context, snapshot, &desc);
    old_headers(context, snapshot, &desc);
    echocast_result_release(result);
    echocast_sensor_release(sensor);
    echocast_snapshot_release(snapshot);
    echocast_scene_release(scene);
    echocast_mesh_release(mesh);
}

static void images(echocast_context *context)
{
    static const unsigned char pixels[] = {255, 0, 0, 0, 0, 255, 99, 99}; /* red, blue; two bytes between rows */
    echocast_image image = ECHOCAST_IMAGE_INIT;
    image.data = pixels;
    image.width = 2;
    image.height = 1;
    echocast_material *material;
    OK(echocast_material_create(context, "{name: print}", &image, &material));
    image.channels = 2;
    echocast_material *none;
    FAILS(ECHOCAST_E_ARGUMENT, "image->channels is 2; allowed: 3 or 4",
          echocast_material_create(context, "{name: print}", &image, &none));
    image.channels = 3;
    image.row_stride = 5;
    FAILS(ECHOCAST_E_ARGUMENT, "image->row_stride is 5; allowed: 0, or 6 and more",
          echocast_material_create(context, "{name: print}", &image, &none));
    image.width = 0;
    FAILS(ECHOCAST_E_ARGUMENT, "image->width is 0;", echocast_material_create(context, "{name: print}", &image, &none));
    CHECK(echocast_material_create(context, "{name: print, shine: 1}", NULL, &none) == ECHOCAST_E_PARSE);

    /* A wall with the image on it: red on the left, blue on the right. */
    static const float corners[] = {5, 5, -5, 5, -5, -5, 5, -5, 5, 5, 5, 5};
    static const uint32_t indices[] = {0, 1, 2, 0, 2, 3};
    static const float uvs[] = {0, 1, 1, 1, 1, 0, 0, 0};
    echocast_part part = ECHOCAST_PART_INIT;
    part.triangle_count = 2;
    part.material = material;
    echocast_mesh_desc desc = ECHOCAST_MESH_DESC_INIT;
    desc.positions = corners;
    desc.vertex_count = 4;
    desc.indices = indices;
    desc.triangle_count = 2;
    desc.uvs = uvs;
    desc.parts = &part;
    desc.part_count = 1;
    echocast_mesh *mesh;
    OK(echocast_mesh_create(context, &desc, &mesh));
    echocast_scene *scene;
    OK(echocast_scene_create(context, NULL, &scene));
    place(scene, mesh, at(0, 0, 0), 1);
    echocast_snapshot *snapshot;
    OK(echocast_scene_commit(scene, &snapshot));
    echocast_sensor *sensor = around(context);
    echocast_result *result = NULL;
    scan_into(snapshot, sensor, "y,red,blue", &result);
    const float *y = view(result, "y").data;
    const uint8_t *red = view(result, "red").data, *blue = view(result, "blue").data;
    CHECK(echocast_result_count(result) > 100);
    for (size_t i = 0; i < echocast_result_count(result); ++i) {
        if (y[i] > 1 && y[i] < 4)
            CHECK(red[i] > blue[i]);
        if (y[i] < -1 && y[i] > -4)
            CHECK(red[i] < blue[i]);
    }
    echocast_result_release(result);
    echocast_sensor_release(sensor);
    echocast_snapshot_release(snapshot);
    echocast_scene_release(scene);
    echocast_mesh_release(mesh);
    echocast_material_release(material);
}

/* Two boxes before a camera of 64 x 48 pixels, the farther one half hidden, and a third one cut off on the right. */
static void boxes_and_layers(echocast_context *context)
{
    echocast_scene *scene;
    OK(echocast_scene_create(context, NULL, &scene));
    echocast_mesh *mesh = box(context);
    place(scene, mesh, at(6, 0, 0), 5);
    place(scene, mesh, at(12, 2, 0), 70000);
    place(scene, mesh, at(5, -5, 0), 2);
    echocast_mesh_release(mesh);
    OK(echocast_scene_name_label(scene, "category", 3, "crate"));
    echocast_snapshot *snapshot;
    OK(echocast_scene_commit(scene, &snapshot));
    echocast_sensor *camera;
    OK(echocast_sensor_from_text(context,
                                 "{name: eye, kind: tof, pattern: {type: pinhole, resolution: [64, 48], "
                                 "fov_deg: [90, 60]}}",
                                 NULL, &camera));
    echocast_sensor_info shape = ECHOCAST_SENSOR_INFO_INIT;
    OK(echocast_sensor_get_info(camera, &shape));
    CHECK(shape.image_width == 64 && shape.image_height == 48 && close_to(shape.focal[0], 32));
    CHECK(shape.centre[0] == 31.5 && shape.centre[1] == 23.5);
    echocast_pose_key here = {0, ECHOCAST_POSE_IDENTITY};
    echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
    desc.sensor = camera;
    desc.poses = &here;
    desc.pose_count = 1;
    desc.frame = 4;
    desc.columns = "all";
    desc.organised = 1;
    desc.boxes = ECHOCAST_BOXES_OBJECT;
    desc.image_boxes = 1;
    echocast_result *result = NULL, *sparse = NULL;
    OK(echocast_scan(snapshot, &desc, &result));

    /* Boxes, by rising number. */
    echocast_box_view boxes;
    OK(echocast_result_boxes(result, &boxes));
    CHECK(boxes.count == 3 && boxes.stride == sizeof(echocast_box));
    const uint32_t numbers[] = {2, 5, 70000};
    const double places[3][2] = {{5, -5}, {6, 0}, {12, 2}};
    const uint32_t *ids = view(result, "instance_id").data;
    for (size_t i = 0; i < boxes.count; ++i) {
        const echocast_box *found = ECHOCAST_AT(echocast_box, boxes, i);
        CHECK(found->instance_id == numbers[i] && found->track_id == numbers[i] && found->category_id == 3);
        CHECK(found->frame == 4 && found->t_ns == 0 && found->reserved == 0);
        CHECK(close_to(found->position[0], places[i][0]) && close_to(found->position[1], places[i][1]));
        CHECK(close_to(found->size[0], 2) && close_to(found->size[1], 2) && close_to(found->size[2], 2));
        CHECK(close_to(found->orientation_xyzw[3], 1) && close_to(found->velocity[0], 0));
        uint32_t points = 0;
        for (size_t k = 0; k < echocast_result_count(result); ++k)
            points += ids[k] == numbers[i];
        CHECK(points > 0 && found->points == points);
        CHECK(i == 2 ? found->visible > 0.3 && found->visible < 0.9 : found->visible == 1);
        CHECK(found->image[0] < found->image[2] && found->image[1] < found->image[3]);
        CHECK(strcmp(echocast_result_label_name(result, "category", found->category_id), "crate") == 0);
    }

    /* Layers of one column are the column. */
    static const char *const layers[][2] = {{"depth", "depth"},         {"range", "range"},
                                            {"category", "category_id"}, {"part", "part_id"},
                                            {"instance", "instance_id"}, {"intensity", "intensity"}};
    for (size_t i = 0; i < sizeof layers / sizeof *layers; ++i) {
        echocast_image_view image;
        OK(echocast_result_image(result, layers[i][0], &image));
        const echocast_view column = view(result, layers[i][1]);
        CHECK(image.data == column.data && image.kind == column.kind);
        CHECK(image.width == 64 && image.height == 48 && image.channels == 1 && image.row_stride == 64 * 4);
    }
    /* Others are made, once. */
    echocast_image_view color, again, normal, depth;
    OK(echocast_result_image(result, "color", &color));
    CHECK(color.kind == ECHOCAST_TYPE_U8 && color.channels == 3 && color.row_stride == 64 * 3);
    OK(echocast_result_image(result, "color", &again));
    CHECK(again.data == color.data);
    OK(echocast_result_image(result, "normal", &normal));
    CHECK(normal.kind == ECHOCAST_TYPE_F32 && normal.channels == 3 && normal.row_stride == 64 * 12);
    OK(echocast_result_image(result, "depth", &depth));
    const float *metres = (const float *)depth.data + 24 * 64 + 32, *up = (const float *)normal.data + 3 * (24 * 64 + 32);
    CHECK(close_to(*metres, 5) && close_to(up[0], 0) && close_to(up[1], 0) && close_to(up[2], 1));
    CHECK(((const uint8_t *)color.data)[3 * (24 * 64 + 32)] == *((const uint8_t *)view(result, "red").data + 24 * 64 + 32));
    CHECK(isnan(*(const float *)depth.data) && *(const uint8_t *)color.data == 0);

    /* What the image shows of each. */
    echocast_image_box_view shown;
    OK(echocast_result_image_boxes(result, &shown));
    CHECK(shown.count == 3 && shown.stride == sizeof(echocast_image_box));
    for (size_t i = 0; i < shown.count; ++i) {
        const echocast_image_box *found = ECHOCAST_AT(echocast_image_box, shown, i);
        const echocast_box *whole = ECHOCAST_AT(echocast_box, boxes, i);
        CHECK(found->instance_id == numbers[i] && found->category_id == 3 && found->area == whole->points);
        CHECK(found->left + found->width <= 64 && found->top + found->height <= 48 && found->reserved == 0);
        CHECK(memcmp(found->amodal, whole->image, sizeof found->amodal) == 0);
        CHECK(close_to(found->occlusion, 1 - whole->visible));
        CHECK(i == 0 ? found->truncation > 0.1 && found->truncation < 1 : found->truncation == 0);
        CHECK(found->left + 1 > found->amodal[0] && found->left + found->width < found->amodal[2] + 1);
    }

    /* Without misses the image is the same, in memory of its own that the next scan reuses. */
    desc.organised = 0;
    OK(echocast_scan(snapshot, &desc, &sparse));
    CHECK(echocast_result_count(sparse) < 64 * 48);
    static const char *const all[] = {"depth", "range",     "category", "part",
                                      "instance", "color", "intensity", "normal"};
    const void *first[8];
    for (int frame = 0; frame < 2; ++frame) {
        for (size_t i = 0; i < 8; ++i) {
            echocast_image_view one, two;
            OK(echocast_result_image(result, all[i], &one));
            OK(echocast_result_image(sparse, all[i], &two));
            CHECK(one.kind == two.kind && one.row_stride == two.row_stride && one.height == two.height);
            CHECK(frame == 0 || two.data == first[i]);
            first[i] = two.data;
            for (size_t k = 0; k < 64 * 48 * (size_t)one.channels; ++k) {
                if (one.kind == ECHOCAST_TYPE_F32) {
                    const float a = ((const float *)one.data)[k], b = ((const float *)two.data)[k];
                    CHECK(a == b || (isnan(a) && isnan(b)));
                }
            }
            if (one.kind != ECHOCAST_TYPE_F32)
                CHECK(memcmp(one.data, two.data, one.row_stride * one.height) == 0);
        }
        OK(echocast_scan(snapshot, &desc, &sparse));
    }

    /* Scans of one sensor are one image, and their boxes are one list. */
    echocast_result *more = NULL;
    OK(echocast_scan(snapshot, &desc, &more));
    OK(echocast_result_append(sparse, more));
    OK(echocast_result_boxes(sparse, &boxes));
    CHECK(boxes.count == 6 && ECHOCAST_AT(echocast_box, boxes, 3)->instance_id == 2);
    OK(echocast_result_image(sparse, "depth", &again));
    CHECK(close_to(((const float *)again.data)[24 * 64 + 32], 5));

    /* Columns, layers and boxes that are not there. */
    FAILS(ECHOCAST_E_ARGUMENT, "there is no image layer named \"dept\"; near: depth, ",
          echocast_result_image(result, "dept", &again));
    CHECK(again.data == NULL && strstr(echocast_last_error(), "normal") != NULL);
    desc.boxes = ECHOCAST_BOXES_NONE;
    FAILS(ECHOCAST_E_ARGUMENT, "desc->image_boxes is 1; allowed: 0 without boxes", echocast_scan(snapshot, &desc, &result));
    desc.image_boxes = 0;
    desc.columns = "depth,intensity";
    desc.organised = 1;
    OK(echocast_scan(snapshot, &desc, &result));
    OK(echocast_result_image(result, "depth", &depth));
    CHECK(close_to(((const float *)depth.data)[24 * 64 + 32], 5));
    FAILS(ECHOCAST_E_ARGUMENT, "layer is part, for which the cloud lacks part_id; allowed: what the columns of the cloud "
          "show, depth, intensity", echocast_result_image(result, "part", &again));
    FAILS(ECHOCAST_E_ARGUMENT, "layer is instance, for which ", echocast_result_image_boxes(result, &shown));
    CHECK(shown.data == NULL && shown.count == 0);
    FAILS(ECHOCAST_E_ARGUMENT, "result is of a scan without boxes; allowed: ", echocast_result_boxes(result, &boxes));
    CHECK(boxes.data == NULL && boxes.count == 0);
    desc.organised = 0;
    OK(echocast_scan(snapshot, &desc, &result));
    FAILS(ECHOCAST_E_ARGUMENT, "layer is depth, for which the cloud lacks beam, range; allowed: what the columns of the "
          "cloud show, none", echocast_result_image(result, "depth", &depth));
    /* Without boxes, what is hidden is not known. */
    desc.columns = "beam,range,category_id,instance_id";
    OK(echocast_scan(snapshot, &desc, &result));
    OK(echocast_result_image_boxes(result, &shown));
    const echocast_image_box *cut = ECHOCAST_AT(echocast_image_box, shown, 0);
    CHECK(shown.count == 3 && isnan(cut->amodal[0]) && isnan(cut->truncation) && isnan(cut->occlusion));

    /* Images are of the sensor as it was when it scanned. */
    OK(echocast_sensor_set(camera, "pattern.resolution", "[32, 24]"));
    OK(echocast_result_image(result, "range", &again));
    CHECK(again.width == 64);
    OK(echocast_scan(snapshot, &desc, &sparse));
    OK(echocast_result_image(sparse, "range", &again));
    CHECK(again.width == 32 && again.height == 24);
    OK(echocast_result_append(result, sparse));
    FAILS(ECHOCAST_E_ARGUMENT, "result is of scans of several sensors", echocast_result_image(result, "range", &again));

    /* A sensor that sweeps has an image too, with slant ranges; one without rows has none. */
    echocast_sensor *sweep = around(context), *prisms;
    desc.sensor = sweep;
    OK(echocast_scan(snapshot, &desc, &result));
    OK(echocast_result_image(result, "depth", &depth));
    CHECK(depth.width >= 360 && depth.height == 11);
    const float *middle = (const float *)depth.data + 5 * (depth.row_stride / sizeof(float)) + depth.width / 2;
    CHECK(close_to(*middle, 5));
    OK(echocast_sensor_create(context, "livox_avia", &prisms));
    desc.sensor = prisms;
    OK(echocast_scan(snapshot, &desc, &sparse));
    FAILS(ECHOCAST_E_UNSUPPORTED, "an image of ", echocast_result_image(sparse, "range", &again));
    const size_t before = echocast_result_count(result);
    desc.boxes = ECHOCAST_BOXES_FRAME;
    desc.image_boxes = 1;
    FAILS(ECHOCAST_E_UNSUPPORTED, "an image of ", echocast_scan(snapshot, &desc, &result));
    CHECK(echocast_result_count(result) == before);
    OK(echocast_result_image(result, "depth", &depth));
    CHECK(depth.height == 11);
    shape.image_width = 9;
    OK(echocast_sensor_get_info(prisms, &shape));
    CHECK(shape.image_width == 0 && shape.focal[0] == 0);
    echocast_sensor_release(prisms);
    echocast_sensor_release(sweep);
    echocast_sensor_release(camera);
    echocast_result_release(more);
    echocast_result_release(sparse);
    echocast_result_release(result);
    echocast_snapshot_release(snapshot);
    echocast_scene_release(scene);
}

/* Whole pings of that sonar, and of an echo sounder. */
static void pings_of(echocast_context *context, const echocast_snapshot *snapshot, echocast_scan_desc desc)
{
    echocast_pings *pings = NULL, *all = NULL;
    echocast_view cells;
    echocast_sounding_view depths;
    CHECK(echocast_pings_count(pings) == 0);
    desc.columns = "intensity,category_id,true_z,x";
    desc.frame = 4;
    desc.t0_ns = 250000000;
    OK(echocast_ping(snapshot, &desc, &pings));
    CHECK(echocast_pings_count(pings) == 1);
    echocast_ping_info info = ECHOCAST_PING_INFO_INIT;
    OK(echocast_pings_get_info(pings, 0, &info));
    CHECK(info.number == 4 && info.t_ns == 250000000 && info.view == ECHOCAST_SONAR_SIDESCAN);
    CHECK(info.beams == 2 && info.bins == 150 && close_to(info.bin_m, 0.1) && info.sensor_pose.m[11] == -2);
    CHECK(info.sound_speed > 1400 && info.sound_speed < 1500 && info.first_bin < 60);
    CHECK(info.axes[0] > 1 && info.axes[2] < -1 && info.threshold_db[149] > info.noise_db && info.tvg_db[149] > 0);
    OK(echocast_pings_view(pings, 0, "intensity", &cells));
    CHECK(cells.count == 300 && cells.kind == ECHOCAST_TYPE_F32 && cells.stride == 4);
    const float *level = cells.data;
    OK(echocast_pings_view(pings, 0, "category_id", &cells));
    const uint32_t *category = cells.data;
    for (uint32_t beam = 0; beam < 2; ++beam) {
        /* Water, and the bed 6 m below. */
        CHECK(category[beam * 150 + 50] == 0 && category[beam * 150 + 90] == 3);
        CHECK(level[beam * 150 + 90] > level[beam * 150 + 50]);
    }
    FAILS(ECHOCAST_E_ARGUMENT, "ping is 1; allowed: less than the 1 there are",
          echocast_pings_view(pings, 1, "intensity", &cells));
    CHECK(cells.data == NULL);
    FAILS(ECHOCAST_E_ARGUMENT, "column is \"time\", which was not computed; allowed: intensity, category_id, true_z",
          echocast_pings_view(pings, 0, "time", &cells));
    OK(echocast_pings_soundings(pings, 0, &depths));
    CHECK(depths.count == 0 && depths.data == NULL);
    uint32_t number;
    CHECK(echocast_pings_label_name(pings, "category", 3) == NULL);
    CHECK(strcmp(echocast_pings_label_name(pings, "instance", 1), "box") == 0);
    OK(echocast_pings_label_number(pings, "instance", "box", &number));
    CHECK(number == 1);
    FAILS(ECHOCAST_E_ARGUMENT, "there is no label named \"bax\"; near: box",
          echocast_pings_label_number(pings, "instance", "bax", &number));

    /* As an image: bins x beams, from 40 dB on in steps of half a dB, and the label beside it. */
    static unsigned char image[300][3];
    size_t needed;
    const echocast_pack_item items[] = {{"intensity", ECHOCAST_TYPE_U8, 0, 40, 2},
                                        {"category_id", ECHOCAST_TYPE_U16, 1, 0, 1}};
    OK(echocast_pings_pack(pings, 0, items, 2, 3, NULL, 0, &needed));
    CHECK(needed == sizeof image);
    OK(echocast_pings_pack(pings, 0, items, 2, 3, image, sizeof image, NULL));
    for (int bin = 0; bin < 150; ++bin) {
        for (int beam = 0; beam < 2; ++beam) {
            double exact = 2 * (level[beam * 150 + bin] - 40.0);
            exact = exact < 0 ? 0 : exact > 255 ? 255 : exact;
            uint16_t label;
            memcpy(&label, image[2 * bin + beam] + 1, 2);
            CHECK(fabs(image[2 * bin + beam][0] - exact) <= 0.5 && label == category[beam * 150 + bin]);
        }
    }
    FAILS(ECHOCAST_E_ARGUMENT, "capacity is 899; allowed: 900 bytes or more",
          echocast_pings_pack(pings, 0, items, 2, 3, image, 899, NULL));

    /* A survey. */
    OK(echocast_ping(snapshot, &desc, &all));
    for (uint32_t frame = 5; frame < 12; ++frame) {
        desc.frame = frame;
        OK(echocast_ping(snapshot, &desc, &pings));
        OK(echocast_pings_append(all, pings));
    }
    CHECK(echocast_pings_count(all) == 8);
    OK(echocast_pings_get_info(all, 7, &info));
    CHECK(info.number == 11);
    FAILS(ECHOCAST_E_ARGUMENT, "other is the same list of pings", echocast_pings_append(all, all));
    desc.columns = "intensity";
    OK(echocast_ping(snapshot, &desc, &pings));
    FAILS(ECHOCAST_E_ARGUMENT, "ping is of another layout, origin, set of columns or labels;",
          echocast_pings_append(all, pings));
    CHECK(echocast_pings_count(all) == 8);
    echocast_image_view pixels, again;
    echocast_image_place place;
    OK(echocast_pings_image(all, "{view: waterfall}", "values", &pixels, &place));
    CHECK(pixels.width == 300 && pixels.height == 8 && pixels.channels == 1 && pixels.kind == ECHOCAST_TYPE_F32);
    CHECK(pixels.row_stride == 1200 && close_to(place.step[0], 0.1) && place.step[1] == 1);
    OK(echocast_pings_image(all, "{view: track, width: 320}", "category_id", &again, NULL));
    CHECK(again.kind == ECHOCAST_TYPE_U32 && again.height > 10);
    OK(echocast_pings_image(all, "{view: waterfall}", "values", &again, NULL));
    CHECK(again.data == pixels.data);
    FAILS(ECHOCAST_E_ARGUMENT, "layer is \"part_id\"; allowed: values, category_id",
          echocast_pings_image(all, "{view: waterfall}", "part_id", &again, NULL));
    CHECK(again.data == NULL);
    FAILS(ECHOCAST_E_ARGUMENT, "fan is requested for a sidescan sonar;",
          echocast_pings_image(all, "{view: fan}", "values", &again, NULL));
    FAILS(ECHOCAST_E_ARGUMENT, "view is top; allowed: waterfall, track or fan for pings",
          echocast_pings_image(all, "{width: 640}", "values", &again, NULL));
    OK(echocast_pings_write(all, in_folder("survey.npz")));
    CHECK(exists(in_folder("survey.npz")));
    FAILS(ECHOCAST_E_UNSUPPORTED, "the ending of the output file", echocast_pings_write(all, in_folder("survey.las")));
    OK(echocast_pings_preview(all, in_folder("survey.png"), "{view: waterfall, color: intensity}"));
    CHECK(exists(in_folder("survey.png")));
    FAILS(ECHOCAST_E_PARSE, "", echocast_pings_preview(all, in_folder("no.png"), "{vew: fan}"));
    CHECK(!exists(in_folder("no.png")));

    /* Nothing changes on an error; one ping is left after the next. */
    echocast_pose_key high = {0, at(0, 0, 1)};
    const echocast_pose_key *under = desc.poses;
    desc.poses = &high;
    FAILS(ECHOCAST_E_ARGUMENT, "the depth of the sonar is -1 m; allowed: 0 to 12000 m",
          echocast_ping(snapshot, &desc, &all));
    desc.poses = under;
    desc.profile = ECHOCAST_PROFILE_PAPER;
    FAILS(ECHOCAST_E_ARGUMENT, "profile is paper;", echocast_ping(snapshot, &desc, &all));
    desc.profile = ECHOCAST_PROFILE_PHYSICAL;
    echocast_sensor *lidar = around(context), *sounder;
    const echocast_sensor *sidescan = desc.sensor;
    desc.sensor = lidar;
    FAILS(ECHOCAST_E_ARGUMENT, "", echocast_ping(snapshot, &desc, &all));
    CHECK(strstr(echocast_last_error(), "sonar") != NULL);
    echocast_pings *none = NULL;
    CHECK(echocast_ping(snapshot, &desc, &none) == ECHOCAST_E_ARGUMENT && none == NULL);
    CHECK(echocast_pings_count(all) == 8);
    desc.sensor = sidescan;
    OK(echocast_ping(snapshot, &desc, &all));
    CHECK(echocast_pings_count(all) == 1);
    FAILS(ECHOCAST_E_ARGUMENT, "layer is \"category_id\"; allowed: values",
          echocast_pings_image(all, "{view: waterfall}", "category_id", &again, NULL));

    /* The bed is 6 m below an echo sounder. */
    OK(echocast_sensor_create(context, "sbes_200", &sounder));
    OK(echocast_sensor_set(sounder, "range.max_m", "15"));
    OK(echocast_sensor_set(sounder, "pattern.rays", "256"));
    desc.sensor = sounder;
    desc.columns = "category_id";
    OK(echocast_ping(snapshot, &desc, &pings));
    OK(echocast_pings_get_info(pings, 0, &info));
    OK(echocast_pings_soundings(pings, 0, &depths));
    CHECK(info.view == ECHOCAST_SONAR_SINGLE && info.beams == 1 && depths.count == 1);
    CHECK(depths.stride == sizeof(echocast_sounding));
    const echocast_sounding *depth = ECHOCAST_AT(echocast_sounding, depths, 0);
    CHECK(depth->beam == 0 && fabs(depth->range - 6) < 0.2 && depth->quality > 0 && depth->quality <= 1);
    CHECK(fabs((depth->cell + 0.5) * info.bin_m - 6) < 0.5 && depth->level_db > info.threshold_db[depth->cell]);
    OK(echocast_pings_view(pings, 0, "category_id", &cells));
    CHECK(((const uint32_t *)cells.data)[depth->cell] == 3);
    CHECK(echocast_pings_view(pings, 0, "intensity", &cells) == ECHOCAST_OK); /* always there */
    echocast_sensor_release(sounder);
    echocast_sensor_release(lidar);
    echocast_pings_release(all);
    echocast_pings_release(pings);
}

/* A side-scan sonar 6 m above a flat bed of sand, in water that is told. */
static void sonars(echocast_context *context)
{
    static const float corners[] = {-20, -20, -8, 20, -20, -8, 20, 20, -8, -20, 20, -8};
    static const uint32_t indices[] = {0, 1, 2, 0, 2, 3};
    echocast_material *material;
    OK(echocast_material_create(context, "{name: bed, sound: {law: sediment, name: medium_sand}}", NULL, &material));
    echocast_part part = ECHOCAST_PART_INIT;
    part.triangle_count = 2;
    part.material = material;
    echocast_mesh_desc shape = ECHOCAST_MESH_DESC_INIT;
    shape.positions = corners;
    shape.vertex_count = 4;
    shape.indices = indices;
    shape.triangle_count = 2;
    shape.parts = &part;
    shape.part_count = 1;
    echocast_mesh *mesh;
    OK(echocast_mesh_create(context, &shape, &mesh));
    echocast_scene *scene;
    OK(echocast_scene_create(context, NULL, &scene));
    place(scene, mesh, at(0, 0, 0), 1);
    echocast_snapshot *snapshot;
    OK(echocast_scene_commit(scene, &snapshot));

    echocast_sensor *sensor;
    OK(echocast_sensor_create(context, "sss_450", &sensor));
    OK(echocast_sensor_set(sensor, "range.max_m", "15"));
    OK(echocast_sensor_set(sensor, "pattern.rays", "512"));
    OK(echocast_sensor_set(sensor, "acoustics.bin_m", "0.1"));
    OK(echocast_sensor_set(sensor, "acoustics.bounces", "0"));
    double value, low, high;
    OK(echocast_sensor_get(sensor, "acoustics.frequency_khz", &value, &low, &high));
    CHECK(value == 450 && low > 1 && high == 5000);
    FAILS(ECHOCAST_E_PARSE, "acoustics.bounces=9: acoustics.bounces: is 9; allowed: 0 to 8",
          echocast_sensor_set(sensor, "acoustics.bounces", "9"));
    echocast_sensor_info about = ECHOCAST_SENSOR_INFO_INIT;
    OK(echocast_sensor_get_info(sensor, &about));
    CHECK(about.rows == 1 && about.columns == 2);

    echocast_pose_key here = {0, at(0, 0, -2)};
    echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
    desc.sensor = sensor;
    desc.poses = &here;
    desc.pose_count = 1;
    desc.columns = "x,y,z,range,intensity,category_id,channel,cause,true_z";
    desc.environment = "{water: {temperature_c: 8, salinity_psu: 0.3, sound_speed: medwin, wind_m_s: 0}}";
    echocast_result *result = NULL;
    OK(echocast_scan(snapshot, &desc, &result));
    echocast_result_info info = ECHOCAST_RESULT_INFO_INIT;
    OK(echocast_result_get_info(result, &info));
    CHECK(info.count > 50 && info.intensity_full_scale == 0);
    const float *range = view(result, "range").data, *level = view(result, "intensity").data;
    const float *y = view(result, "y").data, *true_z = view(result, "true_z").data;
    const uint32_t *category = view(result, "category_id").data;
    const uint16_t *channel = view(result, "channel").data;
    size_t bed[2] = {0, 0};
    for (size_t i = 0; i < info.count; ++i) {
        if (category[i] == 0)
            continue; /* water and its surface */
        CHECK(category[i] == 3 && channel[i] < 2 && (channel[i] == 0) == (y[i] > 0));
        CHECK(range[i] > 5.9 && range[i] < 15 && close_to(true_z[i] + info.origin[2], -8));
        CHECK(level[i] > 40 && level[i] < 200);
        ++bed[channel[i]];
    }
    CHECK(bed[0] > 50 && bed[1] > 50);

    pings_of(context, snapshot, desc);

    /* Pictures of whole pings cannot be made of points. */
    FAILS(ECHOCAST_E_ARGUMENT, "", echocast_result_preview(result, in_folder("ping.png"), "{view: waterfall}"));
    CHECK(strstr(echocast_last_error(), "waterfall") && !exists(in_folder("ping.png")));
    OK(echocast_result_preview(result, in_folder("ping.png"), "{color: intensity}"));

    /* All range bins of both sides. */
    desc.organised = 1;
    OK(echocast_scan(snapshot, &desc, &result));
    OK(echocast_result_get_info(result, &info));
    CHECK(info.rows == 2 && info.columns == 150 && info.count == 300);
    desc.organised = 0;

    here.pose = at(0, 0, 1);
    FAILS(ECHOCAST_E_ARGUMENT, "the depth of the sonar is -1 m; allowed: 0 to 12000 m",
          echocast_scan(snapshot, &desc, &result));
    desc.environment = "{water: {salinity_psu: 60}}";
    CHECK(echocast_scan(snapshot, &desc, &result) != ECHOCAST_OK && strstr(echocast_last_error(), "salinity_psu"));
    CHECK(echocast_result_count(result) == 300);

    echocast_result_release(result);
    echocast_sensor_release(sensor);
    echocast_snapshot_release(snapshot);
    echocast_scene_release(scene);
    echocast_mesh_release(mesh);
    echocast_material_release(material);
}

/* Two contexts do not notice each other, and what one made outlives it. */
static void contexts(echocast_context *context)
{
    echocast_context *other;
    echocast_context_desc desc = ECHOCAST_CONTEXT_DESC_INIT;
    desc.threads = 1;
    OK(echocast_context_create(&desc, &other));
    echocast_mesh *ours = box(context), *theirs = box(other);
    echocast_scene *scene;
    OK(echocast_scene_create(other, NULL, &scene));
    echocast_instance_desc place_desc = ECHOCAST_INSTANCE_DESC_INIT;
    place_desc.mesh = ours;
    FAILS(ECHOCAST_E_HANDLE, "desc->mesh belongs to another context", echocast_scene_add(scene, &place_desc, NULL));
    place(scene, theirs, at(4, 0, 0), 1);
    echocast_sensor *our_sensor = around(context), *their_sensor = around(other);
    echocast_context_release(other);
    echocast_mesh *none;
    echocast_mesh_desc mesh_desc = box_desc();
    FAILS(ECHOCAST_E_HANDLE, "context is 0x", echocast_mesh_create(other, &mesh_desc, &none));
    echocast_snapshot *snapshot;
    OK(echocast_scene_commit(scene, &snapshot));
    echocast_result *result = NULL;
    echocast_pose_key here = {0, ECHOCAST_POSE_IDENTITY};
    echocast_scan_desc scan = ECHOCAST_SCAN_DESC_INIT;
    scan.sensor = our_sensor;
    scan.poses = &here;
    scan.pose_count = 1;
    FAILS(ECHOCAST_E_HANDLE, "desc->sensor belongs to another context", echocast_scan(snapshot, &scan, &result));
    scan_into(snapshot, their_sensor, NULL, &result);
    CHECK(close_to(least(result, "range"), 3));
    echocast_result_release(result);
    echocast_snapshot_release(snapshot);
    echocast_scene_release(scene);
    echocast_sensor_release(our_sensor);
    echocast_sensor_release(their_sensor);
    echocast_mesh_release(ours);
    echocast_mesh_release(theirs);
}

/* A box that drives towards the sensor, 10 m away at time 0, at 20 m/s, and stops after half a second. */
static void motion(echocast_context *context)
{
    echocast_scene *scene;
    OK(echocast_scene_create(context, NULL, &scene));
    echocast_mesh *mesh = box(context);
    echocast_instance car = place(scene, mesh, at(10, 0, 0), 1);
    echocast_mesh_release(mesh);
    echocast_pose_key keys[3] = {{0, at(10, 0, 0)}, {250000000, at(5, 0, 0)}, {500000000, at(0, 0, 0)}};
    OK(echocast_scene_set_motion(scene, car, keys, 3));
    keys[0].pose = at(99, 0, 0); /* They were copied. */

    /* Three rows of 1/30 s each, and the box is met in the middle of each. */
    echocast_sensor *sensor;
    OK(echocast_sensor_from_text(context,
                                 "{name: turning, kind: lidar, pattern: {type: raster, azimuth: {fov_deg: 360, step_deg: 1}, "
                                 "elevation: {fov_deg: 4, step_deg: 2}, rate_hz: 10}}",
                                 NULL, &sensor));
    echocast_pose_key here = {0, ECHOCAST_POSE_IDENTITY};
    echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
    desc.sensor = sensor;
    desc.poses = &here;
    desc.pose_count = 1;
    desc.columns = "x,time,velocity,flow,track_id";
    echocast_snapshot *snapshot;
    echocast_result *result = NULL;
    const int64_t tenth = 100000000;
    double first = INFINITY, last = -INFINITY;
    for (int frame = 0; frame < 3; ++frame) {
        OK(echocast_scene_set_time(scene, frame * tenth, tenth));
        OK(echocast_scene_commit(scene, &snapshot));
        desc.t0_ns = frame * tenth;
        for (desc.freeze = 0; desc.freeze < 2; ++desc.freeze) {
            OK(echocast_scan(snapshot, &desc, &result));
            const float *x = view(result, "x").data, *speed = view(result, "velocity_x").data;
            const float *flow = view(result, "flow_x").data;
            const uint32_t *track = view(result, "track_id").data;
            const double *time = view(result, "time").data;
            CHECK(echocast_result_count(result) > 10);
            for (size_t i = 0; i < echocast_result_count(result); ++i) {
                CHECK(time[i] >= 0.1 * frame && time[i] < 0.1 * frame + 0.1);
                double when = desc.freeze ? 0.1 * frame : time[i];
                CHECK(fabs(x[i] - (9 - 20 * when)) < 1e-3);
                CHECK(fabs(speed[i] + 20) < 1e-3 && fabs(flow[i] + 2) < 1e-3 && track[i] == 1);
                first = frame == 0 && !desc.freeze && time[i] < first ? time[i] : first;
                last = frame == 0 && !desc.freeze && time[i] > last ? time[i] : last;
            }
        }
        desc.freeze = 0;
        if (frame < 2)
            echocast_snapshot_release(snapshot);
    }
    CHECK(first > 0.01 && first < 0.02 && last > 0.08 && last < 0.09);

    /* The snapshot is of 0.2 to 0.3 s. */
    desc.t0_ns = 3 * tenth;
    FAILS(ECHOCAST_E_ARGUMENT, "start_time is 0.3 s for a scan of ", echocast_scan(snapshot, &desc, &result));
    CHECK(strstr(echocast_last_error(), "allowed: within 0.2 to 0.3") != NULL);
    desc.t0_ns = 2 * tenth - 1000000;
    FAILS(ECHOCAST_E_ARGUMENT, "start_time is 0.199 s for a scan of ", echocast_scan(snapshot, &desc, &result));
    echocast_snapshot_release(snapshot);
    /* Without length everything holds still, whatever the time of a scan. */
    OK(echocast_scene_set_time(scene, 4 * tenth, 0));
    OK(echocast_scene_commit(scene, &snapshot));
    OK(echocast_scan(snapshot, &desc, &result));
    CHECK(close_to(least(result, "x"), 1) && *(const float *)view(result, "velocity_x").data == 0);
    echocast_snapshot_release(snapshot);

    FAILS(ECHOCAST_E_ARGUMENT, "length_ns is -1; allowed: 0 or more", echocast_scene_set_time(scene, 0, -1));
    FAILS(ECHOCAST_E_ARGUMENT, "keys is none; allowed: at least one", echocast_scene_set_motion(scene, car, NULL, 0));
    FAILS(ECHOCAST_E_ARGUMENT, "keys is NULL", echocast_scene_set_motion(scene, car, NULL, 2));
    FAILS(ECHOCAST_E_HANDLE, "id is 0x", echocast_scene_set_motion(scene, car + 1, keys, 3));
    keys[2].t_ns = 249999999;
    FAILS(ECHOCAST_E_ARGUMENT, "time of key 2 is 0.249999999; allowed: finite times that never fall",
          echocast_scene_set_motion(scene, car, keys, 3));
    keys[2].t_ns = 250000000;
    keys[1].pose.m[3] = NAN;
    FAILS(ECHOCAST_E_ARGUMENT, "pose of object \"box\" is ", echocast_scene_set_motion(scene, car, keys, 3));
    memset(&keys[1].pose, 0, sizeof keys[1].pose);
    FAILS(ECHOCAST_E_ARGUMENT, "keys[1].pose is all 0; ", echocast_scene_set_motion(scene, car, keys, 3));
    keys[1].pose = at(5, 0, 0);
    keys[1].pose.m[1] = 0.5; /* sheared */
    FAILS(ECHOCAST_E_ARGUMENT, "pose of key 1 is [", echocast_scene_set_motion(scene, car, keys, 3));
    /* It moves as before. */
    OK(echocast_scene_commit(scene, &snapshot));
    OK(echocast_scan(snapshot, &desc, &result));
    CHECK(close_to(least(result, "x"), 1));
    echocast_snapshot_release(snapshot);
    /* Until it is placed elsewhere; two keys at one time are a jump. */
    echocast_pose there = at(7, 0, 0);
    OK(echocast_scene_set_poses(scene, 1, &car, &there));
    OK(echocast_scene_commit(scene, &snapshot));
    OK(echocast_scan(snapshot, &desc, &result));
    CHECK(close_to(least(result, "x"), 6));
    echocast_snapshot_release(snapshot);
    keys[0].pose = at(3, 0, 0);
    keys[1].pose = at(4, 0, 0);
    keys[2].pose = at(8, 0, 0);
    OK(echocast_scene_set_motion(scene, car, keys, 3));
    OK(echocast_scene_commit(scene, &snapshot));
    OK(echocast_scan(snapshot, &desc, &result));
    CHECK(close_to(least(result, "x"), 7));
    echocast_snapshot_release(snapshot);
    echocast_result_release(result);
    echocast_sensor_release(sensor);
    echocast_scene_release(scene);
}

int main(int argc, char **argv)
{
    CHECK(argc == 2);
    snprintf(folder, sizeof folder, "%s", argv[1]);
    library();
    echocast_context_desc desc = ECHOCAST_CONTEXT_DESC_INIT;
    desc.threads = 2;
    desc.log = take_message;
    desc.log_user = messages;
    desc.log_level = ECHOCAST_LOG_INFO;
    echocast_context *context;
    OK(echocast_context_create(&desc, &context));
    CHECK(messages[ECHOCAST_LOG_INFO] == 1 && strstr(last_message, "threads: 2"));
    desc.threads = -1;
    echocast_context *none;
    FAILS(ECHOCAST_E_ARGUMENT, "desc->threads is -1;", echocast_context_create(&desc, &none));
    desc.threads = 0;
    desc.log_level = 9;
    FAILS(ECHOCAST_E_ARGUMENT, "desc->log_level is 9;", echocast_context_create(&desc, &none));
    meshes(context);
    scenes(context);
    pictures_of_motion(context);
    files(context);
    sensors(context);
    scans(context);
    images(context);
    boxes_and_layers(context);
    sonars(context);
    motion(context);
    contexts(context);
    echocast_context_release(context);
    puts("passed");
    return 0;
}
