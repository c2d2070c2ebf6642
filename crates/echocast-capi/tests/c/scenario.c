/* What the functions of scenarios do, and how they fail. argv[1]: a folder for files. */
#define _POSIX_C_SOURCE 200809L
#include "check.h"
#include "folder.h"

#include <pthread.h>
#include <sched.h>

static void write_file(const char *name, const char *text)
{
    FILE *file = fopen(in_folder(name), "wb");
    CHECK(file != NULL && fputs(text, file) >= 0 && fclose(file) == 0);
}

/* A wall across the x axis, which stands elsewhere in each sample. */
static const char WALL[] = "o Wall\nv 5 -9 -9\nv 5 9 -9\nv 5 9 9\nv 5 -9 9\nf 1 2 3 4\n";

static const char RIG[] =
    "scene: {files: wall.obj}\n"
    "sensors:\n"
    "  - {name: front, sensor: {name: ten, kind: lidar, pattern: {type: raster, rate_hz: 10,\n"
    "      azimuth: {fov_deg: 10, step_deg: 1}, elevation: {fov_deg: 10, step_deg: 1}}}}\n"
    "  - {name: slow \xe2\x98\x83, sensor: {name: five, kind: lidar, pattern: {type: raster, rate_hz: 5,\n"
    "      azimuth: {fov_deg: 12, step_deg: 2}, elevation: {fov_deg: 12, step_deg: 2}}},\n"
    "      mount: {position_m: [1, 0, 0]}, rate_hz: 5, start_s: 0.25}\n"
    "trajectory: {position_m: [0, 0, 0]}\n"
    "frames: {first: 2, last: 11, step: 3}\n"
    "fields: [x, time, category_id]\n"
    "samples: 5\n"
    "variation:\n"
    "  - {move: Wall, by_m: [{uniform: [-2, 2]}, 0, 0]}\n"
    "  - {set: sensors.front.start_s, to: 0}\n";

static int warnings;
static char last_warning[512];

static void take_warning(void *user, int32_t level, const char *text)
{
    CHECK(user == &warnings);
    if (level == ECHOCAST_LOG_WARN) {
        ++warnings;
        snprintf(last_warning, sizeof last_warning, "%s", text);
    }
}

static void reads(echocast_context *context)
{
    echocast_scenario *scenario;
    uint64_t samples;
    OK(echocast_scenario_load(context, in_folder("rig.yaml"), &scenario));
    OK(echocast_scenario_samples(scenario, &samples));
    CHECK(samples == 5);

    echocast_sample *sample;
    size_t scans;
    OK(echocast_scenario_sample(scenario, 3, &sample));
    OK(echocast_sample_scans(sample, &scans));
    CHECK(scans == 2);
    char name[64];
    echocast_scan_info scan = ECHOCAST_SCAN_INFO_INIT;
    OK(echocast_sample_get_scan(sample, 0, &scan));
    CHECK(scan.frames == 4 && scan.name == NULL);
    scan.name = name;
    scan.name_capacity = sizeof name;
    OK(echocast_sample_get_scan(sample, 1, &scan));
    CHECK(scan.frames == 5 && strcmp(name, "slow \xe2\x98\x83") == 0);
    scan.name_capacity = 7; /* not in the middle of a character */
    OK(echocast_sample_get_scan(sample, 1, &scan));
    CHECK(strcmp(name, "slow ") == 0);

    /* Frames 2, 5, 8, 11 at 10 Hz; and as many of 5 Hz as start before the next would, from 0.25 s after the first. */
    for (size_t i = 0; i < 4; ++i) {
        echocast_frame_info frame = ECHOCAST_FRAME_INFO_INIT;
        OK(echocast_sample_get_frame(sample, 0, i, &frame));
        CHECK(frame.number == 2 + 3 * i && frame.start_ns == 100000000 * (int64_t)(2 + 3 * i));
        CHECK(frame.duration_ns > 80000000 && frame.duration_ns < 100000000 && frame.reserved == 0);
    }
    for (size_t i = 0; i < 5; ++i) {
        echocast_frame_info frame = ECHOCAST_FRAME_INFO_INIT;
        OK(echocast_sample_get_frame(sample, 1, i, &frame));
        CHECK(frame.number == i && frame.start_ns == 450000000 + 200000000 * (int64_t)i);
    }

    /* What was drawn is where the wall stands. */
    char json[512];
    size_t needed;
    OK(echocast_sample_drawn(sample, json, sizeof json, &needed));
    CHECK(needed == strlen(json) + 1 && json[0] == '[' && json[needed - 2] == ']');
    CHECK(strstr(json, "\"rule\":\"move Wall\"") != NULL && strstr(json, "\"key\":\"sensors.front.start_s\"") != NULL);
    OK(echocast_sample_drawn(sample, json, 5, NULL));
    CHECK(strlen(json) == 4);

    /* The columns are the scenario's, or others. */
    echocast_result *result = NULL, *again = NULL;
    echocast_view column;
    OK(echocast_sample_scan(sample, 0, 1, NULL, &result));
    CHECK(echocast_result_count(result) == 121);
    const double *time = view(result, "time").data;
    CHECK(time[0] >= 0.5 && time[120] < 0.6);
    const float wall = least(result, "x");
    CHECK(wall > 3 && wall < 7 && view(result, "category_id").count == 121);
    CHECK(strcmp(echocast_result_label_name(result, "category", *(const uint32_t *)view(result, "category_id").data),
                 "Wall") == 0);
    FAILS(ECHOCAST_E_ARGUMENT, "column is \"range\", which was not computed",
          echocast_result_view(result, "range", &column));
    OK(echocast_sample_scan(sample, 0, 1, "default,range", &result));
    CHECK(view(result, "range").count == 121 && view(result, "time").count == 121);
    OK(echocast_sample_scan(sample, 0, 1, "range", &result));
    FAILS(ECHOCAST_E_ARGUMENT, "column is \"x\", which was not computed", echocast_result_view(result, "x", &column));
    OK(echocast_sample_scan(sample, 1, 0, "x,range", &result));
    CHECK(echocast_result_count(result) == 49 && close_to(least(result, "x"), wall));
    CHECK(close_to(least(result, "range"), wall - 1));

    /* Boxes, once they are asked for; an image of the scan's own sensor. */
    echocast_box_view boxes;
    echocast_image_view image;
    CHECK(echocast_result_boxes(result, &boxes) == ECHOCAST_E_ARGUMENT);
    OK(echocast_sample_set_boxes(sample, ECHOCAST_BOXES_OBJECT, 1));
    OK(echocast_sample_scan(sample, 1, 0, "category_id,instance_id,range,beam", &result));
    OK(echocast_result_boxes(result, &boxes));
    const echocast_box *box = ECHOCAST_AT(echocast_box, boxes, 0);
    CHECK(boxes.count == 1 && box->points == 49 && box->t_ns >= 450000000 && box->t_ns < 650000000 && close_to(box->position[0], wall));
    OK(echocast_result_image(result, "range", &image));
    CHECK(image.width == 7 && image.height == 7 && close_to(((const float *)image.data)[24], wall - 1));
    OK(echocast_sample_scan(sample, 0, 0, "beam,range", &result));
    OK(echocast_result_image(result, "range", &image));
    CHECK(image.width == 11);
    OK(echocast_sample_set_boxes(sample, ECHOCAST_BOXES_NONE, 0));
    OK(echocast_sample_scan(sample, 1, 0, "x,range", &result));
    CHECK(echocast_result_boxes(result, &boxes) == ECHOCAST_E_ARGUMENT && boxes.count == 0);

    /* A sensor is a copy: it stays when the sample goes, and changing it changes nothing there. */
    echocast_sensor *sensor;
    echocast_sensor_info shape = ECHOCAST_SENSOR_INFO_INIT;
    OK(echocast_sample_sensor(sample, 1, &sensor));
    OK(echocast_sensor_get_info(sensor, &shape));
    CHECK(shape.rows == 7 && shape.columns == 7 && shape.period_ns == 200000000);
    OK(echocast_sensor_set(sensor, "range.max_m", "1"));
    OK(echocast_sample_scan(sample, 1, 0, "all", &result));
    CHECK(echocast_result_count(result) == 49);

    /* The same sample again, after its scenario; of another number another one, beyond the last too. */
    echocast_sample *same, *other;
    OK(echocast_scenario_sample(scenario, 3, &same));
    OK(echocast_scenario_sample(scenario, 4294967295, &other));
    echocast_scenario_release(scenario);
    OK(echocast_sample_scan(same, 1, 0, "all", &again));
    check_same(result, again, NULL);
    OK(echocast_sample_scan(other, 1, 0, "all", &again));
    CHECK(!close_to(least(again, "x"), wall));
    echocast_sample_release(same);
    echocast_sample_release(other);
    echocast_sample_release(sample);
    OK(echocast_sensor_get_info(sensor, &shape));
    CHECK(echocast_result_count(result) == 49);
    echocast_sensor_release(sensor);
    echocast_result_release(again);
    echocast_result_release(result);
}

static void changes(echocast_context *context)
{
    echocast_scenario *scenario;
    echocast_sample *before, *after;
    echocast_result *result = NULL;
    uint64_t samples;
    size_t needed;
    char json[16];
    OK(echocast_scenario_from_text(context, RIG, folder, &scenario));
    OK(echocast_scenario_sample(scenario, 0, &before));
    OK(echocast_scenario_set(scenario, "samples", "7"));
    OK(echocast_scenario_set(scenario, "variation", "[]"));
    OK(echocast_scenario_set(scenario, "sensors.front.mount", "{position_m: [-1, 0, 0]}"));
    OK(echocast_scenario_set(scenario, "fields", "[range]"));
    OK(echocast_scenario_samples(scenario, &samples));
    CHECK(samples == 7);
    OK(echocast_scenario_sample(scenario, 0, &after));
    OK(echocast_sample_drawn(after, json, sizeof json, &needed));
    CHECK(strcmp(json, "[]") == 0 && needed == 3);
    OK(echocast_sample_scan(after, 0, 0, NULL, &result));
    CHECK(close_to(least(result, "range"), 6));
    /* The one that was made before has what it had. */
    OK(echocast_sample_scan(before, 0, 0, NULL, &result));
    CHECK(view(result, "time").count == 121);
    echocast_sample_release(before);
    echocast_sample_release(after);

    /* What is refused changes nothing. */
    FAILS(ECHOCAST_E_PARSE, "", echocast_scenario_set(scenario, "samples", "many"));
    CHECK(strstr(echocast_last_error(), "samples") && strstr(echocast_last_error(), "many"));
    FAILS(ECHOCAST_E_PARSE, "", echocast_scenario_set(scenario, "sensors.back.rate_hz", "5"));
    CHECK(strstr(echocast_last_error(), "sensors, a list of 2, has no entry called \"back\""));
    OK(echocast_scenario_samples(scenario, &samples));
    CHECK(samples == 7);
    echocast_scenario_release(scenario);
    echocast_result_release(result);
}

static void fails(echocast_context *context)
{
    echocast_scenario *scenario = (echocast_scenario *)folder;
    FAILS(ECHOCAST_E_IO, in_folder("no.yaml"), echocast_scenario_load(context, in_folder("no.yaml"), &scenario));
    CHECK(scenario == NULL && strstr(echocast_last_error(), "No such file"));

    /* File, line and key. */
    write_file("wrong.yaml", "scene: {files: wall.obj}\nsensors:\n  - {sensor: velodyne_vlp16, rate_h: 5}\n");
    FAILS(ECHOCAST_E_PARSE, in_folder("wrong.yaml"),
          echocast_scenario_load(context, in_folder("wrong.yaml"), &scenario));
    CHECK(strstr(echocast_last_error(), "line 3") && strstr(echocast_last_error(), "rate_h"));
    CHECK(strchr(echocast_last_error(), '\n') == NULL && scenario == NULL);

    /* A scene that is not there is missed by the sample that needs it, and found once it is. */
    OK(echocast_scenario_from_text(context,
                                   "{scene: {files: late.obj}, sensors: [{sensor: velodyne_vlp16}], "
                                   "trajectory: {position_m: [0, 0, 0]}}",
                                   folder, &scenario));
    echocast_sample *sample = (echocast_sample *)folder, *none = sample;
    FAILS(ECHOCAST_E_IO, in_folder("late.obj"), echocast_scenario_sample(scenario, 0, &sample));
    CHECK(sample == NULL && strstr(echocast_last_error(), "No such file"));
    write_file("late.obj", WALL);
    OK(echocast_scenario_sample(scenario, 0, &sample));
    FAILS(ECHOCAST_E_ARGUMENT, "sample is 4294967296; allowed: 0 to 4294967295",
          echocast_scenario_sample(scenario, 4294967296, &none));
    CHECK(none == NULL);

    /* Numbers of scans and frames. */
    echocast_scan_info scan = ECHOCAST_SCAN_INFO_INIT;
    echocast_frame_info frame = ECHOCAST_FRAME_INFO_INIT;
    echocast_sensor *sensor = (echocast_sensor *)folder;
    echocast_result *result = NULL;
    FAILS(ECHOCAST_E_ARGUMENT, "scan is 1; allowed: less than the 1 there are",
          echocast_sample_get_scan(sample, 1, &scan));
    FAILS(ECHOCAST_E_ARGUMENT, "scan is 1;", echocast_sample_get_frame(sample, 1, 0, &frame));
    FAILS(ECHOCAST_E_ARGUMENT, "frame is 1; allowed: less than the 1 there are",
          echocast_sample_get_frame(sample, 0, 1, &frame));
    FAILS(ECHOCAST_E_ARGUMENT, "scan is 1;", echocast_sample_sensor(sample, 1, &sensor));
    CHECK(sensor == NULL);
    FAILS(ECHOCAST_E_ARGUMENT, "scan is 1;", echocast_sample_scan(sample, 1, 0, NULL, &result));
    FAILS(ECHOCAST_E_ARGUMENT, "frame is 1;", echocast_sample_scan(sample, 0, 1, NULL, &result));
    FAILS(ECHOCAST_E_ARGUMENT, "", echocast_sample_scan(sample, 0, 0, "x,rnage", &result));
    CHECK(strstr(echocast_last_error(), "rnage") && result == NULL);

    /* An old result stays as it was; one of another context is refused. */
    OK(echocast_sample_scan(sample, 0, 0, NULL, &result));
    const size_t points = echocast_result_count(result);
    CHECK(points > 10);
    FAILS(ECHOCAST_E_ARGUMENT, "frame is 9;", echocast_sample_scan(sample, 0, 9, NULL, &result));
    CHECK(echocast_result_count(result) == points);
    echocast_context_desc desc = ECHOCAST_CONTEXT_DESC_INIT;
    desc.threads = 1;
    echocast_context *others;
    OK(echocast_context_create(&desc, &others));
    echocast_scenario *theirs;
    echocast_sample *their_sample;
    OK(echocast_scenario_load(others, in_folder("rig.yaml"), &theirs));
    OK(echocast_scenario_sample(theirs, 0, &their_sample));
    FAILS(ECHOCAST_E_HANDLE, "*io belongs to another context", echocast_sample_scan(their_sample, 0, 0, NULL, &result));
    echocast_sample_release(their_sample);
    echocast_scenario_release(theirs);
    echocast_context_release(others);

    /* Handles that stand for nothing any more. */
    echocast_sample_release(sample);
    FAILS(ECHOCAST_E_HANDLE, "sample is 0x", echocast_sample_scan(sample, 0, 0, NULL, &result));
    CHECK(strstr(echocast_last_error(), "which is not a valid sample"));
    FAILS(ECHOCAST_E_HANDLE, "sample is 0x", echocast_sample_get_scan(sample, 0, &scan));
    FAILS(ECHOCAST_E_HANDLE, "scenario is 0x", echocast_scenario_sample((echocast_scenario *)sample, 0, &sample));
    echocast_scenario_release(scenario);
    FAILS(ECHOCAST_E_HANDLE, "scenario is 0x", echocast_scenario_set(scenario, "samples", "1"));
    echocast_result_release(result);
}

/* What a sample has to say goes to the log. */
static void warns(echocast_context *context)
{
    echocast_scenario *scenario;
    echocast_sample *sample;
    write_file("box.obj", "o Box\nv 0 0 0\nv 99 0 0\nv 0 99 0\nv 0 0 99\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n");
    OK(echocast_scenario_load(context, in_folder("rig.yaml"), &scenario));
    OK(echocast_scenario_set(scenario, "variation",
                             "[{place: box.obj, at: {within: {min_m: [4, 0, 0], max_m: [5, 1, 1]}}, tries: 2}]"));
    warnings = 0;
    OK(echocast_scenario_sample(scenario, 0, &sample));
    CHECK(warnings == 1 && strstr(last_warning, "box"));
    echocast_sample_release(sample);
    echocast_scenario_release(scenario);
}

static echocast_scenario *shared;
static echocast_sample *first;
static echocast_result *expected[5];

/* Makes all samples, while others do, ask for changes and scan one sample. */
static void *maker(void *unused)
{
    echocast_result *result = NULL;
    for (uint64_t i = 0; i < 5; ++i) {
        echocast_sample *sample;
        echocast_status status;
        while ((status = echocast_scenario_sample(shared, i, &sample)) == ECHOCAST_E_BUSY)
            sched_yield();
        OK(status);
        OK(echocast_sample_scan(sample, 0, 3, "all", &result));
        check_same(result, expected[i], NULL);
        echocast_sample_release(sample);
        /* Either somebody is making a sample, or the value is refused: the scenario stays. */
        status = echocast_scenario_set(shared, "samples", "none");
        CHECK(status == ECHOCAST_E_BUSY || status == ECHOCAST_E_PARSE);
        /* A sample that another thread scans is refused until that is done. */
        while ((status = echocast_sample_scan(first, 0, 3, "all", &result)) == ECHOCAST_E_BUSY)
            sched_yield();
        OK(status);
        check_same(result, expected[0], NULL);
    }
    echocast_result_release(result);
    return unused;
}

static void side_by_side(int32_t threads)
{
    enum { MAKERS = 6 };
    echocast_context_desc desc = ECHOCAST_CONTEXT_DESC_INIT;
    desc.threads = threads;
    echocast_context *context;
    OK(echocast_context_create(&desc, &context));
    OK(echocast_scenario_load(context, in_folder("rig.yaml"), &shared));
    for (uint64_t i = 0; i < 5; ++i) {
        echocast_sample *sample;
        OK(echocast_scenario_sample(shared, i, &sample));
        expected[i] = NULL;
        OK(echocast_sample_scan(sample, 0, 3, "all", &expected[i]));
        echocast_sample_release(sample);
    }
    OK(echocast_scenario_sample(shared, 0, &first));
    pthread_t makers[MAKERS];
    for (int i = 0; i < MAKERS; ++i)
        CHECK(pthread_create(&makers[i], NULL, maker, NULL) == 0);
    for (int i = 0; i < MAKERS; ++i)
        CHECK(pthread_join(makers[i], NULL) == 0);
    for (int i = 0; i < 5; ++i)
        echocast_result_release(expected[i]);
    echocast_sample_release(first);
    echocast_scenario_release(shared);
    echocast_context_release(context);
}

int main(int argc, char **argv)
{
    CHECK(argc == 2);
    snprintf(folder, sizeof folder, "%s", argv[1]);
    write_file("wall.obj", WALL);
    write_file("rig.yaml", RIG);
    echocast_context_desc desc = ECHOCAST_CONTEXT_DESC_INIT;
    desc.threads = 2;
    desc.log = take_warning;
    desc.log_user = &warnings;
    echocast_context *context;
    OK(echocast_context_create(&desc, &context));
    reads(context);
    changes(context);
    fails(context);
    warns(context);
    side_by_side(1);
    side_by_side(3);
    echocast_context_release(context);
    puts("passed");
    return 0;
}
