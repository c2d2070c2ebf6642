/* Includes the headers a second time, for a program of two files. */
#include <echocast.h>
#include <echocast.h>

echocast_scan_desc second(void);

echocast_scan_desc second(void)
{
    echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
    return desc;
}
