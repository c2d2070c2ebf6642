/* Every structure with its defaults, in C and in C++; prints their bytes, which a test compares with the library's own.
 * argv[1] is not used. */
#include <echocast.h>

#include <stdio.h>
#include <string.h>

#ifdef __cplusplus
extern "C"
#endif
    echocast_scan_desc
    second(void);

static void print(const char *name, const void *structure, size_t size)
{
    const unsigned char *bytes = (const unsigned char *)structure;
    size_t i;
    printf("%s ", name);
    for (i = 0; i < size; ++i)
        printf("%02x", (unsigned)bytes[i]);
    printf("\n");
}

/* Padding is 0 on both sides. */
#define PRINT(type, init)                                                                                              \
    do {                                                                                                               \
        static const type value = init;                                                                                \
        print(#type, &value, sizeof value);                                                                            \
    } while (0)

int main(void)
{
    echocast_scan_desc other = second();
    static const echocast_scan_desc mine = ECHOCAST_SCAN_DESC_INIT;
    PRINT(echocast_context_desc, ECHOCAST_CONTEXT_DESC_INIT);
    PRINT(echocast_image, ECHOCAST_IMAGE_INIT);
    PRINT(echocast_mesh_desc, ECHOCAST_MESH_DESC_INIT);
    PRINT(echocast_instance_desc, ECHOCAST_INSTANCE_DESC_INIT);
    PRINT(echocast_scene_desc, ECHOCAST_SCENE_DESC_INIT);
    PRINT(echocast_beams_desc, ECHOCAST_BEAMS_DESC_INIT);
    PRINT(echocast_instance_info, ECHOCAST_INSTANCE_INFO_INIT);
    PRINT(echocast_scene_info, ECHOCAST_SCENE_INFO_INIT);
    PRINT(echocast_sensor_info, ECHOCAST_SENSOR_INFO_INIT);
    PRINT(echocast_scan_desc, ECHOCAST_SCAN_DESC_INIT);
    PRINT(echocast_result_info, ECHOCAST_RESULT_INFO_INIT);
    PRINT(echocast_ping_info, ECHOCAST_PING_INFO_INIT);
    PRINT(echocast_radar_info, ECHOCAST_RADAR_INFO_INIT);
    PRINT(echocast_scan_info, ECHOCAST_SCAN_INFO_INIT);
    PRINT(echocast_frame_info, ECHOCAST_FRAME_INFO_INIT);
    {
        static const echocast_part part = ECHOCAST_PART_INIT;
        if (part.material || part.triangle_count)
            return 1;
    }
    return memcmp(&other, &mine, sizeof mine) != 0 || echocast_version() != ECHOCAST_VERSION;
}
