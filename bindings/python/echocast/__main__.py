from echocast._program import main

main()
