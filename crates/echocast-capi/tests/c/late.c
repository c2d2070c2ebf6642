/* Calls that fail when their thread has all but ended: they have no place left for a sentence, and say nothing.
 * argv[1] is not used. */
#define _POSIX_C_SOURCE 200809L
#include "check.h"

#include <pthread.h>

static pthread_key_t key;

static void fail(void)
{
    CHECK(echocast_mesh_prepare(NULL) == ECHOCAST_E_ARGUMENT);
    CHECK(echocast_last_error() != NULL);
}

static void at_end(void *round)
{
    fail();
    /* Once more, after the destructors of others. */
    if (*(int *)round < 3) {
        ++*(int *)round;
        pthread_setspecific(key, round);
    }
}

static void *thread(void *round)
{
    pthread_setspecific(key, round);
    fail();
    return NULL;
}

int main(int argc, char **argv)
{
    int round = 0;
    pthread_t other;
    (void)argc;
    (void)argv;
    CHECK(pthread_key_create(&key, at_end) == 0);
    CHECK(pthread_create(&other, NULL, thread, &round) == 0 && pthread_join(other, NULL) == 0);
    CHECK(round == 3);
    fail();
    CHECK(atexit(fail) == 0);
    puts("passed");
    return 0;
}
