/* Frames of a radar that looks at a plate 20 m ahead. argv[1]: a folder for files. */
#include "check.h"
#include "folder.h"

int main(int argc, char **argv)
{
    CHECK(argc == 2);
    snprintf(folder, sizeof folder, "%s", argv[1]);
    echocast_context_desc context_desc = ECHOCAST_CONTEXT_DESC_INIT;
    echocast_context *context;
    OK(echocast_context_create(&context_desc, &context));
    static const float corners[] = {20, -0.5f, -0.5f, 20, 0.5f, -0.5f, 20, 0.5f, 0.5f, 20, -0.5f, 0.5f};
    static const uint32_t indices[] = {0, 2, 1, 0, 3, 2};
    echocast_material *material;
    OK(echocast_material_create(context, "{name: plate, reflectance: 0.5, radar: {law: metal}}", NULL, &material));
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
    OK(echocast_sensor_create(context, "ti_awr1843", &sensor));

    echocast_pose_key here = {0, ECHOCAST_POSE_IDENTITY};
    echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
    desc.sensor = sensor;
    desc.poses = &here;
    desc.pose_count = 1;
    desc.frame = 3;
    echocast_radar *radar = NULL;
    echocast_result *detections = NULL, *scanned = NULL;
    OK(echocast_radar_frame(snapshot, &desc, ECHOCAST_RADAR_CUBE, &radar, &detections));
    echocast_radar_info info = ECHOCAST_RADAR_INFO_INIT;
    OK(echocast_radar_get_info(radar, &info));
    CHECK(info.number == 3 && info.channels >= 8 && info.velocities > 1 && info.ranges > 1);
    CHECK(info.cube != NULL && info.elements != NULL && info.samples == NULL && info.polar_dbm == NULL);
    CHECK(fabs(info.wavelength_m - 3.9e-3) < 0.1e-3 && info.range_step_m > 0 && info.velocity_step > 0);
    /* The strongest cell is the plate: at its range, without a velocity. */
    size_t layer = (size_t)info.velocities * info.ranges, strongest = 0;
    double most = 0;
    for (size_t cell = 0; cell < layer; ++cell) {
        double power = 0;
        for (size_t channel = 0; channel < info.channels; ++channel) {
            const float *value = info.cube + 2 * (channel * layer + cell);
            power += (double)value[0] * value[0] + (double)value[1] * value[1];
        }
        if (power > most) {
            most = power;
            strongest = cell;
        }
    }
    double range = info.first_range_m + (double)(strongest % info.ranges) * info.range_step_m;
    double velocity = info.first_velocity + (double)(strongest / info.ranges) * info.velocity_step;
    CHECK(fabs(range - 20) <= info.range_step_m && fabs(velocity) <= info.velocity_step);

    /* The detections are those of a scan. */
    OK(echocast_scan(snapshot, &desc, &scanned));
    CHECK(echocast_result_count(detections) > 0 && echocast_result_count(detections) == echocast_result_count(scanned));
    CHECK(fabs(((const float *)view(detections, "range").data)[0] - ((const float *)view(scanned, "range").data)[0]) == 0);

    /* Samples, into the same frame. */
    desc.frame = 4;
    OK(echocast_radar_frame(snapshot, &desc, ECHOCAST_RADAR_SAMPLES, &radar, NULL));
    OK(echocast_radar_get_info(radar, &info));
    CHECK(info.number == 4 && info.cube == NULL && info.samples != NULL && info.velocities == 0);
    CHECK(info.sample_shape[1] * info.sample_shape[2] == info.channels && info.sample_shape[3] > 1);
    OK(echocast_radar_write(radar, in_folder("adc.bin")));
    CHECK(exists(in_folder("adc.bin")));
    FAILS(ECHOCAST_E_ARGUMENT, "view range_doppler is of frame 4, which has no cube; allowed: a frame with a cube",
          echocast_radar_preview(radar, in_folder("no.png"), "{view: range_doppler}"));

    OK(echocast_radar_frame(snapshot, &desc, ECHOCAST_RADAR_CUBE | ECHOCAST_RADAR_SAMPLES, &radar, &detections));
    OK(echocast_radar_get_info(radar, &info));
    CHECK(info.cube != NULL && info.samples != NULL);
    OK(echocast_radar_write(radar, in_folder("frame.npz")));
    OK(echocast_radar_preview(radar, in_folder("azimuth.png"), "{view: range_azimuth, width: 400}"));
    CHECK(exists(in_folder("frame.npz")) && exists(in_folder("azimuth.png")) && !exists(in_folder("no.png")));
    FAILS(ECHOCAST_E_UNSUPPORTED, "the ending of the output file", echocast_radar_write(radar, in_folder("frame.las")));

    /* A refused frame leaves the last one. */
    FAILS(ECHOCAST_E_ARGUMENT, "record is 4;", echocast_radar_frame(snapshot, &desc, 4, &radar, NULL));
    desc.profile = ECHOCAST_PROFILE_PAPER;
    FAILS(ECHOCAST_E_ARGUMENT, "profile is paper;", echocast_radar_frame(snapshot, &desc, 0, &radar, NULL));
    OK(echocast_radar_get_info(radar, &info));
    CHECK(info.number == 4 && info.cube != NULL);

    echocast_radar_release(radar);
    echocast_result_release(detections);
    echocast_result_release(scanned);
    echocast_snapshot_release(snapshot);
    echocast_scene_release(scene);
    echocast_mesh_release(mesh);
    echocast_material_release(material);
    echocast_sensor_release(sensor);
    echocast_context_release(context);
    puts("passed");
    return 0;
}
