# A device without objects but 1000h: a reset ends the program, which is started again, and a stop
# ends it as a defect would.
echo '(0.000000) can0 701#00'
while read -r stamp interface frame; do
    case $frame in
    601#40001000*) echo '(0.000000) can0 581#4300100091010000' ;;
    601#40*)
        rest=${frame#601#40}
        echo "(0.000000) can0 581#80${rest%00000000}00000206"
        ;;
    000#8100 | 000#8101 | 000#8200 | 000#8201) exit 0 ;;
    000#02*) exit 3 ;;
    esac
done
